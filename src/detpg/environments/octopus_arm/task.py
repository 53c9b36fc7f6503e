"""The octopus arm of Section 5.3: hit a target with any part of the arm."""

import math
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from detpg.environments.octopus_arm.actions import primitives
from detpg.environments.octopus_arm.body import Arm, at_rest, body_of
from detpg.environments.octopus_arm.geometry import Point, distance, touches, turned
from detpg.environments.octopus_arm.integration import advance
from detpg.environments.octopus_arm.observation import State, from_vector, scale_of, to_vector
from detpg.environments.octopus_arm.parameters import OctopusParameters, checked_episode, choose
from detpg.environments.octopus_arm.physics import activate, derivative
from detpg.environments.octopus_arm.targets import draw, place
from detpg.types import Action, EnvironmentSpec, Number, Observation, check_hyper, hyper, strong


class OctopusArm(eqx.Module):
    """Octopus arm of S segments in water, on a base that turns, in a plane (Section 5.3).

    **Observation** (2 + 8S numbers, 50 for S = 6; L: about a segment, T: a fifth of a step)

    | index | quantity | unit | min | max |
    | --- | --- | --- | --- | --- |
    | 0 | theta, angle of the upper base node | rad | about -5 | about 5 |
    | 1 | omega, its rate | rad/T | -inf | inf |
    | 2+4i ... 5+4i | x, y, vx, vy of upper node i+1, base to tip | L, L/T | -inf | inf |
    | 2+4S+4i ... 5+4S+4i | the same of lower node i+1 | L, L/T | -inf | inf |
    | 2+8S, 3+8S | x, y of the target, with `random_targets` only | L | -inf | inf |

    **Action** (2 + 3S numbers, 20 for S = 6), capped to [0, 1]

    | index | quantity | unit | min | max |
    | --- | --- | --- | --- | --- |
    | 0, 1 | torque on the base, counter-clockwise, clockwise | full torque | 0 | 1 |
    | 2+3i ... 4+3i | dorsal, transversal, ventral muscle of segment i | full | 0 | 1 |

    **Dynamics.** Masses at the nodes, muscles as damped springs, compartments of constant area,
    quadratic drag (`physics`); 25 Runge-Kutta steps of 0.2 T. Theta is wrapped to [-pi, pi] at the
    start of a step, so that the observed one can be past pi.

    **Reward.** `distance_weight` times the decrease of the distance from the target to the nearest
    node, and `hit_reward` in the step that hits. No noise.

    **Start.** At rest along +x, or turned about the base by an angle that is uniform between
    -`start_noise` and `start_noise`. **Termination.** When a step ends with the target inside a
    compartment: its outline winds around it. The time limit, 300 steps, is no termination.

    **What the paper says, what we chose.** The paper has six segments, 50 and 20 numbers, the form
    of the reward, +50 and 300 steps. That fits one public simulator, RL-Library's, whose equations
    and constants (set A) these are; the rest is open (docs/decisions/0024, docs/octopus.md).

    **Version history.** 0: first version.

    Attributes:
        parameters: Material constants and shape at rest.
        target: Where the target is, unless each episode draws one.
        observation_scale: What each observed number is divided by.
        distance_weight: Reward for a decrease of the distance by 1.
        hit_reward: Reward for a hit.
        start_noise: Greatest angle of the start.
        random_targets: Whether each episode draws a target and shows it (static).
        time_limit: Steps of an episode (static).
        discount: gamma (static).
    """

    parameters: OctopusParameters
    target: Point
    observation_scale: Float[Array, "obs"]
    distance_weight: Number = hyper("reward per length", 1.0, 0.0, 1e6)
    hit_reward: Number = hyper("reward", 50.0, 0.0, 1e6)
    start_noise: Number = hyper("rad", 0.0, 0.0, math.pi)
    random_targets: bool = eqx.field(static=True, default=False)
    time_limit: int = eqx.field(static=True, default=300)
    discount: float = eqx.field(static=True, default=0.99)

    def __init__(
        self,
        num_segments: int | None = None,
        parameters: str | OctopusParameters = "A",
        *,
        target: str | Point | Sequence[float] = "default",
        observation_scale: str | Float[Array, "obs"] | Sequence[float] = "raw",
        distance_weight: float | Number = 1.0,
        hit_reward: float | Number = 50.0,
        start_noise: float | Number = 0.0,
        random_targets: bool = False,
        time_limit: int = 300,
        discount: float = 0.99,
        key: PRNGKeyArray | None = None,
    ):
        """Builds an arm; `key` is not needed. Without `num_segments`, six or all of one's own.

        Targets go by name (`TARGETS`) or by x and y; scales are "raw", "unit" (numbers of about 1)
        or one divisor for each observed number.

        Raises:
            ValueError: What no arm can be built from, in one sentence.
        """
        self.parameters = choose(parameters, num_segments)
        segments = self.parameters.num_segments
        self.observation_scale = scale_of(observation_scale, segments, random_targets)
        self.distance_weight, self.hit_reward = strong(distance_weight), strong(hit_reward)
        self.start_noise, self.random_targets = strong(start_noise), random_targets
        self.time_limit, self.discount = checked_episode(time_limit, discount)
        check_hyper(self)
        self.target = place(target, self.parameters, None if random_targets else self.start_noise)

    @property
    def spec(self) -> EnvironmentSpec:
        m = 2 + 3 * self.parameters.num_segments
        size, box = self.observation_scale.shape[-1], ((0.0,) * m, (1.0,) * m)
        return EnvironmentSpec("octopus-arm", size, m, *box, self.time_limit, self.discount)

    @property
    def macro_actions(self) -> Float[Array, "8 act"]:
        """The eight primitives of the Java simulators, see `primitives`."""
        return primitives(self.parameters.num_segments)

    def initial(self, key: PRNGKeyArray) -> State:
        turn_key, target_key = jax.random.split(key)
        body, arm = body_of(self.parameters), at_rest(self.parameters)
        turn = self.start_noise * jax.random.uniform(turn_key, (), arm.x.dtype, -1.0, 1.0)
        arm = turned(body, arm, turn)
        return State(arm, draw(target_key, body, arm) if self.random_targets else self.target)

    def transition(self, key: PRNGKeyArray, state: State, action: Action) -> State:
        arm = advance(body_of(self.parameters), jnp.clip(action, 0.0, 1.0), state.arm)
        return State(arm, state.target)

    def reward(self, state: State, action: Action, next_state: State) -> Number:
        body = body_of(self.parameters)
        before, after = (distance(body, s.arm, s.target) for s in (state, next_state))
        bonus = jnp.where(self.terminated(next_state), self.hit_reward, 0.0)
        return self.distance_weight * (before - after) + bonus

    def terminated(self, state: State) -> Bool[Array, ""]:
        return touches(body_of(self.parameters), state.arm, state.target)

    def observe(self, state: State) -> Observation:
        vector = to_vector(state.arm)
        seen = jnp.concatenate([vector, state.target]) if self.random_targets else vector
        return seen / self.observation_scale

    def derivative(self, state: State, action: Action) -> Arm:
        """Rates of change under an action, of which only the activations are capped here."""
        body = body_of(self.parameters)
        return derivative(body, activate(body, action), state.arm)

    def to_vector(self, state: State) -> Float[Array, "numbers"]:
        """The arm as 2 + 8S numbers in the observation's order, not scaled."""
        return to_vector(state.arm)

    def from_vector(self, vector: Float[Array, "numbers"]) -> State:
        """The state of such a vector, with the environment's target."""
        return State(from_vector(vector), self.target)
