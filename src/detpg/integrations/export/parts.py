"""What a controller is made of: its normaliser, its policy with parameters, its bounds."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from detpg.algorithms import ALGORITHMS
from detpg.policies import FeatureGaussian, IsotropicGaussian
from detpg.types import Action, Algorithm, EnvironmentSpec, Observation
from detpg.version import __version__
from detpg.wrappers import Controller, Metered, Normalised
from detpg.wrappers.normalised import MOST

THETA = ("theta", "u", "parameters")  # what the learners call the parameters of their policy


class Normaliser(NamedTuple):
    """(s - mean) / deviation, cut off at `most` on both sides."""

    mean: Float[Array, "obs"]
    deviation: Float[Array, "obs"]
    most: float = MOST


class Parts(NamedTuple):
    """The learner inside all wrappers with its state, and the normaliser around it, if any."""

    algorithm: Algorithm
    learner: PyTree
    normaliser: Normaliser | None


def parts_of(controller: Controller) -> Parts:
    """The controller, taken out of its wrappers."""
    algorithm, learner, normaliser = controller.algorithm, controller.learner, None
    while isinstance(algorithm, Normalised | Metered):
        if isinstance(algorithm, Normalised) and algorithm.observations:
            moments = learner.observations
            normaliser = Normaliser(moments.mean, moments.deviation)
        algorithm, learner = algorithm.algorithm, learner.learner
    return Parts(algorithm, learner, normaliser)


def mean_policy(parts: Parts) -> tuple[Any, PyTree]:
    """Mu and its parameters: of a Gaussian policy its mean; (None, None) of an unknown learner."""
    policy = getattr(parts.algorithm, "policy", None)
    theta = next((getattr(parts.learner, n) for n in THETA if hasattr(parts.learner, n)), None)
    if policy is None or theta is None:
        return None, None
    if isinstance(policy, FeatureGaussian):
        return policy.mean, theta.mean
    if isinstance(policy, IsotropicGaussian):
        return policy.mean, theta.theta
    return policy, theta


def deployed(controller: Controller) -> Callable[[Observation], Action]:
    """What is exported: the controller, for which a denormal number is 0.

    XLA takes it for 0 in some operations and not in others, by the machine; a file has one answer.
    """

    def action(observation: Observation) -> Action:
        least = jnp.asarray(jnp.finfo(observation.dtype).tiny, observation.dtype)
        tiny = jnp.abs(observation) < least
        return controller(jnp.where(tiny, jnp.zeros_like(observation), observation))

    return action


@contextmanager
def single_precision_mode() -> Iterator[None]:
    """JAX computes in float32 throughout, also where a device would multiply with fewer bits."""
    with jax.enable_x64(False), jax.default_matmul_precision("highest"):
        yield


def single_precision(controller: Controller) -> Controller:
    """The controller with float32 numbers, which is what every exported file computes with.

    Raises:
        ValueError: Numbers that are not finite: such a controller diverged.
    """

    def converted(leaf: Any) -> Any:
        if not jnp.issubdtype(jnp.result_type(leaf), jnp.floating):
            return leaf
        return jnp.asarray(np.asarray(leaf), jnp.float32)

    controller = jax.tree.map(converted, controller)
    for path, leaf in jax.tree_util.tree_leaves_with_path(controller.learner):
        if jnp.issubdtype(leaf.dtype, jnp.floating) and not np.all(np.isfinite(leaf)):
            raise ValueError(
                f"The learner's state{jax.tree_util.keystr(path)} is not finite: it diverged and "
                "is no controller; export an earlier one."
            )
    return controller


def about(
    controller: Controller, observation_size: int, spec: EnvironmentSpec | None
) -> dict[str, Any]:
    """What every exported file says of itself; a bound that is missing is None."""
    algorithm = parts_of(controller).algorithm
    names = (name for name, known in ALGORITHMS.items() if type(algorithm) is known)
    return {
        "detpg": __version__,
        "algorithm": next(names, type(algorithm).__name__),
        "environment": spec.name if spec is not None else None,
        "observation_size": observation_size,
        "action_size": len(controller.bounds.low),
        "action_low": [_or_none(x) for x in controller.bounds.low],
        "action_high": [_or_none(x) for x in controller.bounds.high],
    }


def _or_none(bound: float) -> float | None:
    return bound if math.isfinite(bound) else None
