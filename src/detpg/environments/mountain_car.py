"""The mountain car with continuous throttle of Section 5.2."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from detpg.types import Action, EnvironmentSpec, Number, Observation, strong

State = Float[Array, "2"]

POSITION = (-1.2, 0.6)
SPEED = 0.07
THROTTLE = 1.0


class MountainCar(eqx.Module):
    """Mountain car with continuous throttle, as RLPark has it (Section 5.2).

    **Observation** (2 numbers; the state)

    | index | quantity | unit | min | max |
    | --- | --- | --- | --- | --- |
    | 0 | position p | length | -1.2 | 0.6 |
    | 1 | velocity v | length per step | -0.07 | 0.07 |

    **Action** (1 number)

    | index | quantity | unit | min | max |
    | --- | --- | --- | --- | --- |
    | 0 | throttle a, cut off at the limits | full throttle | -1 | 1 |

    **Dynamics.** v' = clip(v + 0.001 a - 0.0025 cos 3p); p' = p + v'. Left of the valley p' and v'
    are stopped by a wall: v' = 0, p' = -1.2. On the right p' is cut off at 0.6.

    **Reward.** -1 for each step, also for the last.

    **Start.** p = -0.5, v = 0; with `random_start`, uniform over all positions and velocities.
    **Termination.** p >= 0.6, the right edge itself; the time limit is 5000 steps.

    **What the paper says, what we chose.** The paper says "mountain car" and that actions were
    capped at the legal range; it does not give the equations. These are the ones of RLPark, the
    library of one of the authors. Gymnasium's `MountainCarContinuous` is another task (power
    0.0015, goal at 0.45, a cost of actions, a reward at the goal).

    **Version history.** 0: first version.

    Attributes:
        power: Acceleration at full throttle, length per squared step.
        gravity: Greatest acceleration by gravity, length per squared step.
        slope: Angular frequency of the hills, radians per length.
        goal: Position at which the episode ends.
        start: p of the fixed start.
        random_start: Whether episodes start anywhere (static).
    """

    power: Number = eqx.field(default=0.001, converter=strong)
    gravity: Number = eqx.field(default=0.0025, converter=strong)
    slope: Number = eqx.field(default=3.0, converter=strong)
    goal: Number = eqx.field(default=0.6, converter=strong)
    start: Number = eqx.field(default=-0.5, converter=strong)
    random_start: bool = eqx.field(default=False, static=True)

    @property
    def spec(self) -> EnvironmentSpec:
        return EnvironmentSpec(
            name="mountain-car",
            observation_size=2,
            action_size=1,
            action_low=(-THROTTLE,),
            action_high=(THROTTLE,),
            time_limit=5000,
            discount=0.99,
            observation_low=(POSITION[0], -SPEED),
            observation_high=(POSITION[1], SPEED),
        )

    def initial(self, key: PRNGKeyArray) -> State:
        if not self.random_start:
            return jnp.stack([self.start, jnp.zeros_like(self.start)])
        p, v = jax.random.uniform(key, (2,), self.power.dtype)
        low, high = POSITION
        return jnp.stack([low + (high - low) * p, SPEED * (2 * v - 1)])

    def transition(self, key: PRNGKeyArray, state: State, action: Action) -> State:
        p, v = state
        throttle = jnp.clip(action[0], -THROTTLE, THROTTLE)
        v = v + self.power * throttle - self.gravity * jnp.cos(self.slope * p)
        v = jnp.clip(v, -SPEED, SPEED)
        p = p + v
        v = jnp.where(p < POSITION[0], jnp.zeros_like(v), v)
        return jnp.stack([jnp.clip(p, *POSITION), v])

    def reward(self, state: State, action: Action, next_state: State) -> Number:
        return -jnp.ones_like(self.power)

    def terminated(self, state: State) -> Bool[Array, ""]:
        return state[0] >= self.goal

    def observe(self, state: State) -> Observation:
        return state
