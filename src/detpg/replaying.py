"""Learning from logged transitions: what some behaviour did, once and for all.

In: an algorithm and the data. Out: the learner's state and a log, as of `detpg.training`.
Next: `detpg.evaluation` plays its greedy policy.

No action is drawn here and no importance weight is needed: a deterministic off-policy learner reads
what was done, and asks its own mu_theta(s') what it would do next. Step t uses `fold_in(key, t)`
and the row that its epoch's order gives it, so that a run resumed from a saved `ReplayState` with
the same key and data is equal to the bit.
"""

import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray, PyTree

from detpg.algorithms import COPDACGQ, COPDACQ, DAC, OffPAC, StochasticAC
from detpg.training import Log
from detpg.types import Algorithm, Bounds, EnvironmentSpec, Transition

Rows = Array | np.ndarray  # of data as they are read, on the host

# Learners for which transitions of another behaviour are wrong, and why.
REFUSED: dict[type[Algorithm], str] = {
    DAC: "its Sarsa critic learns the value of the behaviour that it acts with itself",
    StochasticAC: "it is on-policy, and the actions must come from its own Gaussian",
    OffPAC: "it divides by the density of the behaviour, which logged data do not tell",
}
# Those whose critic is linear in a - mu_theta(s): a straight line through what the behaviour did.
COMPATIBLE = (COPDACQ, COPDACGQ)


class Logged(eqx.Module):
    """Transitions in the order in which they happened, one in each row.

    Attributes:
        observation: s.
        action: a, in units of the box: 1 is a bound where a component has both.
        reward: r.
        next_observation: s', before any reset; means nothing where `terminated`.
        terminated: Whether s' is terminal.
        truncated: Whether the episode was cut after this step.
        episode: Number of the episode, from 0.
        bounds: The box of legal actions in the world's own units (static).
    """

    observation: Float[Rows, "time obs"]
    action: Float[Rows, "time act"]
    reward: Float[Rows, "time"]
    next_observation: Float[Rows, "time obs"]
    terminated: Bool[Rows, "time"]
    truncated: Bool[Rows, "time"]
    episode: Int[Rows, "time"]
    bounds: Bounds = eqx.field(static=True)

    def __len__(self) -> int:
        return self.reward.shape[0]

    def spec(self, discount: float) -> EnvironmentSpec:
        """What a learner must know of the world, actions in units of the box.

        Args:
            discount: gamma; data do not tell.
        """
        sizes = self.observation.shape[1], self.action.shape[1]
        return EnvironmentSpec("logged", *sizes, *self.bounds.scaled, len(self), discount)


class ReplayState(eqx.Module):
    """Everything that the rest of a run depends on, besides its key and the data."""

    learner: PyTree
    step: Int[Array, ""]


def learn_from(
    algorithm: Algorithm,
    data: Logged,
    key: PRNGKeyArray,
    steps: int,
    start: ReplayState | None = None,
) -> tuple[ReplayState, Log]:
    """Learns from logged transitions, one in each step. Pure: jit and vmap it as you like.

    Each epoch goes through all transitions once, in an order of its own. They are unrelated, so
    each is told to end what a learner carries from step to step; only `terminated` stops
    bootstrapping. a' is mu_theta(s'), without noise.

    Args:
        algorithm: The learner: off-policy, and in no need of the behaviour's density.
        data: What it learns from.
        key: Key of the run; give the same one to every call that continues it.
        steps: Updates (static). A call draws the order of each epoch that it touches.
        start: Where to continue; from the beginning when not given.

    Returns:
        The state after the last update, and the log.

    Raises:
        ValueError: A learner for which such data are wrong, or no step.
    """
    check_learner(algorithm)
    if steps < 1:
        raise ValueError(f"steps = {steps} is not usable: give 1 or more.")
    if steps >= 2**31:
        raise ValueError(f"steps = {steps} is not usable: give less than 2^31.")
    loop_key, order_key, begin_key = jax.random.split(key, 3)
    if start is None:
        start = ReplayState(algorithm.init(begin_key), jnp.asarray(0, dtype=int))

    def body(state: ReplayState, row: Int[Array, ""]) -> tuple[ReplayState, Log]:
        key = jax.random.fold_in(loop_key, state.step)
        transition = _transition(algorithm, state.learner, data, row)
        learner, info = algorithm.update(key, state.learner, transition)
        return ReplayState(learner, state.step + 1), Log(info=info, probe=None)

    return jax.lax.scan(body, start, _rows(order_key, start.step, steps, len(data)))


def check_learner(algorithm: Algorithm) -> None:
    """Refuses a learner that another behaviour's transitions would mislead; warns of some.

    Raises:
        ValueError: Says why, and what to take.
    """
    inside = algorithm
    while (within := getattr(inside, "algorithm", None)) is not None:  # as the wrappers call it
        inside = within
    why = REFUSED.get(type(inside))
    if inside.experience.kind == "recalled":
        why = "it keeps a memory of what it tries itself"
    if inside.experience.kind == "fresh":
        batch = inside.experience.batch
        why = f"it takes batches of {batch} actions of its own policy in a bandit"
    if why is not None:
        raise ValueError(
            f"{type(inside).__name__} cannot learn from logged data, since {why}: take opdac."
        )
    if isinstance(inside, COMPATIBLE):
        warnings.warn(
            f"{type(inside).__name__} reads its slope at the behaviour's actions, not at its own: "
            "it improves on the behaviour and then goes too far, so start from the behaviour and "
            "stop early, or take opdac.",
            stacklevel=3,
        )


def _transition(
    algorithm: Algorithm, learner: PyTree, data: Logged, row: Int[Array, ""]
) -> Transition:
    next_observation = _at(data.next_observation, row)
    return Transition(
        observation=_at(data.observation, row),
        action=_at(data.action, row),
        reward=_at(data.reward, row),
        next_observation=next_observation,
        next_action=algorithm.greedy(learner, next_observation),
        terminated=jnp.asarray(data.terminated)[row],
        truncated=jnp.asarray(True),  # the next row is somewhere else
    )


def _at(column: Float[Rows, "time ..."], row: Int[Array, ""]) -> Float[Array, "..."]:
    """One row in the learner's precision: data are in single."""
    return jnp.asarray(column)[row].astype(float)


def _rows(key: PRNGKeyArray, step: Int[Array, ""], steps: int, size: int) -> Int[Array, "steps"]:
    """The rows of `steps` steps: of each epoch that they touch, its order; those cut out."""
    first = step // size
    epochs = first + jnp.arange((steps + size - 2) // size + 1)
    orders = jax.vmap(lambda epoch: jax.random.permutation(jax.random.fold_in(key, epoch), size))
    return jax.lax.dynamic_slice_in_dim(orders(epochs).reshape(-1), step - first * size, steps)
