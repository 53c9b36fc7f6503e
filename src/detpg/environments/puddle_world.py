"""The two-dimensional puddle world of Section 5.2."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from detpg.types import Action, EnvironmentSpec, Number, Observation, strong

State = Float[Array, "2"]

STEP = 0.05
BUMP_MEANS = ((0.3, 0.6), (0.4, 0.5), (0.8, 0.9))
BUMP_WIDTHS = ((0.1, 0.03), (0.03, 0.1), (0.03, 0.1))


class PuddleWorld(eqx.Module):
    """Puddle world, as RLPark has it (Section 5.2).

    **Observation** (2 numbers; the state)

    | index | quantity | unit | min | max |
    | --- | --- | --- | --- | --- |
    | 0, 1 | position x, y in a square room | side of the room | 0 | 1 |

    **Action** (2 numbers)

    | index | quantity | unit | min | max |
    | --- | --- | --- | --- | --- |
    | 0, 1 | step along x, y, each cut off at the limits | side of the room | -0.05 | 0.05 |

    **Dynamics.** s' = clip(s + a + noise), the noise uniform in +-0.0025 along each axis, added
    after the action is cut off; the walls of the room cut off s'.

    **Reward.** -1 - 2 (sum of three normal densities at s'), with standard deviations (0.1, 0.03)
    around (0.3, 0.6), (0.03, 0.1) around (0.4, 0.5) and (0.03, 0.1) around (0.8, 0.9). The
    densities are normalised: each is 53 at its peak, so that the worst reward is about -130.

    **Start.** (0.2, 0.4). **Termination.** At less than 0.1 from (1, 1), distances added over the
    axes; the time limit is 5000 steps.

    **What the paper says, what we chose.** The paper says "2-D puddle world" and does not give
    equations; these are RLPark's. RLPark delivers the arriving step twice, the second time marked
    as the end; here the episode ends on arrival, whose reward counts once
    (docs/decisions/0020). The width of the noise is that of RLPark's demonstration; ports that cite
    Degris et al. (2012b) use `noise=0.025`. Zero action returns -14 thousand on average with the
    narrow noise, -29 thousand with the wide one; the paper's Figure 2 starts at -17 +- 5 thousand.

    **Version history.** 0: first version.

    Attributes:
        noise: Greatest size of the noise along each axis, sides of the room.
        start: First position.
        goal: Where to go.
        reach: How near the goal is near enough, distances added over the axes.
        bump_means: Centres of the puddles.
        bump_widths: Standard deviations of the puddles.
        depth: What multiplies the densities in the reward.
    """

    noise: Number = eqx.field(default=0.0025, converter=strong)
    start: State = eqx.field(default=(0.2, 0.4), converter=strong)
    goal: State = eqx.field(default=(1.0, 1.0), converter=strong)
    reach: Number = eqx.field(default=0.1, converter=strong)
    bump_means: Float[Array, "puddles 2"] = eqx.field(default=BUMP_MEANS, converter=strong)
    bump_widths: Float[Array, "puddles 2"] = eqx.field(default=BUMP_WIDTHS, converter=strong)
    depth: Number = eqx.field(default=2.0, converter=strong)

    @property
    def spec(self) -> EnvironmentSpec:
        return EnvironmentSpec(
            name="puddle-world",
            observation_size=2,
            action_size=2,
            action_low=(-STEP, -STEP),
            action_high=(STEP, STEP),
            time_limit=5000,
            discount=0.999,
            observation_low=(0.0, 0.0),
            observation_high=(1.0, 1.0),
        )

    def initial(self, key: PRNGKeyArray) -> State:
        return self.start

    def transition(self, key: PRNGKeyArray, state: State, action: Action) -> State:
        return self.move(state, action, jax.random.uniform(key, (2,), self.noise.dtype))

    def move(self, state: State, action: Action, uniform: Float[Array, "2"]) -> State:
        """What an action does, given the draws from [0, 1) that the noise is made of."""
        step = jnp.clip(action, -STEP, STEP) + self.noise * (2 * uniform - 1)
        return jnp.clip(state + step, 0.0, 1.0)

    def reward(self, state: State, action: Action, next_state: State) -> Number:
        distance = (next_state[None, :] - self.bump_means) / self.bump_widths
        peak = 1 / (2 * jnp.pi * jnp.prod(self.bump_widths, axis=1))
        densities = peak * jnp.exp(-jnp.sum(distance**2, axis=1) / 2)
        return -1 - self.depth * jnp.sum(densities)

    def terminated(self, state: State) -> Bool[Array, ""]:
        return jnp.sum(jnp.abs(self.goal - state)) < self.reach

    def observe(self, state: State) -> Observation:
        return state
