"""The swing-up pendulum of Section 5.2."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from detpg.types import Action, EnvironmentSpec, Number, Observation, strong

State = Float[Array, "2"]

SPEED = math.pi / 4 / 0.01
TORQUE = 2.0


class Pendulum(eqx.Module):
    """Swing-up pendulum, as RLPark has it (Section 5.2).

    **Observation** (2 numbers; the state)

    | index | quantity | unit | min | max |
    | --- | --- | --- | --- | --- |
    | 0 | angle from upright | rad | -pi | pi |
    | 1 | velocity v | rad per 100 steps | -78.54 | 78.54 |

    **Action** (1 number)

    | index | quantity | unit | min | max |
    | --- | --- | --- | --- | --- |
    | 0 | torque u, cut off at the limits | N m | -2 | 2 |

    **Dynamics.** v' = clip(v - 0.01 v + 9.8 sin(angle) + u), at most pi/4 per step in size;
    angle' = angle + 0.01 v', wrapped to [-pi, pi). The torque is too weak to lift the rod in one
    go: it has to be swung.

    **Reward.** cos(angle'): 1 upright, -1 hanging.

    **Start.** Horizontal, angle pi/2, v = 0; with `random_start`, the angle is uniform.
    **Termination.** Never; the time limit is 5000 steps.

    **What the paper says, what we chose.** The paper says "pendulum" and does not give equations;
    these are RLPark's. RLPark adds the whole acceleration to v, not 0.01 times it. We keep that: it
    is part of the task, since zero action then earns -4946 over 5000 steps, where the paper's
    Figure 2 shows -4941 (with 0.01 times the acceleration: -2869). In units in which it is plain
    Euler integration: w = v/10, steps of 0.1 s, w' = w + 0.1 (9.8 sin(angle) + u - 0.1 w),
    angle' = angle + 0.1 w', |w| at most 2.5 pi rad/s.

    **Version history.** 0: first version.

    Attributes:
        gravity: g / l of the rod, 1 / s^2.
        friction: Share of v lost in each step.
        step: What 1 of v adds to the angle in each step, rad.
        start: Angle of the fixed start, rad.
        random_start: Whether episodes start at any angle (static).
    """

    gravity: Number = eqx.field(default=9.8, converter=strong)
    friction: Number = eqx.field(default=0.01, converter=strong)
    step: Number = eqx.field(default=0.01, converter=strong)
    start: Number = eqx.field(default=math.pi / 2, converter=strong)
    random_start: bool = eqx.field(default=False, static=True)

    @property
    def spec(self) -> EnvironmentSpec:
        return EnvironmentSpec(
            name="pendulum",
            observation_size=2,
            action_size=1,
            action_low=(-TORQUE,),
            action_high=(TORQUE,),
            time_limit=5000,
            discount=0.99,
            observation_low=(-math.pi, -SPEED),
            observation_high=(math.pi, SPEED),
        )

    def initial(self, key: PRNGKeyArray) -> State:
        angle = self.start
        if self.random_start:
            angle = math.pi * (2 * jax.random.uniform(key, (), self.gravity.dtype) - 1)
        return jnp.stack([angle, jnp.zeros_like(angle)])

    def transition(self, key: PRNGKeyArray, state: State, action: Action) -> State:
        angle, v = state
        torque = jnp.clip(action[0], -TORQUE, TORQUE)
        # Undivided: see "what we chose".
        acceleration = self.gravity * jnp.sin(angle) + torque - self.friction * v
        v = jnp.clip(v + acceleration, -SPEED, SPEED)
        angle = angle + self.step * v
        angle = jnp.where(angle >= math.pi, angle - 2 * math.pi, angle)
        angle = jnp.where(angle < -math.pi, angle + 2 * math.pi, angle)
        return jnp.stack([angle, v])

    def reward(self, state: State, action: Action, next_state: State) -> Number:
        return jnp.cos(next_state[0])

    def terminated(self, state: State) -> Bool[Array, ""]:
        return jnp.asarray(False)

    def observe(self, state: State) -> Observation:
        return state
