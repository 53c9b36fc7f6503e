"""What learners of recalled batches share: their state, their parts, exploration, Adam's steps."""

import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int, PRNGKeyArray, PyTree

from detpg.algorithms.parts import validate
from detpg.critics.ensemble import EnsembleActionValues
from detpg.critics.targets import smoothing_noise
from detpg.experience import Experience
from detpg.policies.behaviour import cap
from detpg.policies.network import NetworkPolicy
from detpg.policies.noise import ColouredNoise, NoiseState
from detpg.types import Action, EnvironmentSpec, Number, Observation, of_episode

ADAM = optax.scale_by_adam()
HORIZONS = 5.0  # of the discount, in an episode
LEAST_GAMMA, MOST_GAMMA, USUAL_GAMMA = 0.95, 0.995, 0.99
LONGEST_STRETCH = 1_000  # steps of noise that are drawn at once
# Whole numbers that a learner may have, and the least of each.
WHOLE = {"memory": 1, "batch": 1, "updates": 1, "n": 1, "delay": 1, "warm_up": 0}
UNLIMITED = 2**31 - 1  # a time limit that is none


class ReplayState(eqx.Module):
    """Actor, critics, their targets and optimisers; all that the next update needs.

    Attributes:
        theta: Of the policy.
        w: Of the action values.
        target_theta: theta', which follows theta.
        target_w: w', which follows w.
        actor_optimiser: Adam's moments of theta.
        critic_optimiser: Adam's moments of w.
        updates: So far.
        noise: Of exploration, one for each world.
    """

    theta: PyTree
    w: PyTree
    target_theta: PyTree
    target_w: PyTree
    actor_optimiser: PyTree
    critic_optimiser: PyTree
    updates: Int[Array, ""]
    noise: NoiseState = of_episode()


class ReplayInfo(eqx.Module):
    """Diagnostics of one update: root mean square error of Q_1 on its target, its mean value."""

    delta: Number
    value: Number


def validate_replay(learner: Any) -> None:
    """Refuses a learner whose options, hyper-parameters, bounds or whole numbers cannot be.

    Raises:
        ValueError: Names the one that cannot be, and what would.
    """
    validate(learner)
    for name, least in WHOLE.items():
        value = getattr(learner, name, least)
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise ValueError(
                f"{name} = {value!r} is not usable: give a whole number of {least} or more."
            )


@property
def recalled(learner: Any) -> Experience:
    """The `experience` of a learner that recalls."""
    numbers = {name: getattr(learner, name) for name in ("batch", "warm_up", "updates", "n")}
    return Experience("recalled", capacity=learner.memory, **numbers)


def discount_of(time_limit: int) -> float:
    """Gamma whose horizon is a fifth of an episode, within 0.95 and 0.995 (Hansen et al., 2024)."""
    if time_limit >= UNLIMITED:
        return USUAL_GAMMA
    return min(max(1 - HORIZONS / time_limit, LEAST_GAMMA), MOST_GAMMA)


def replay_parts(spec: EnvironmentSpec, critics: int) -> dict[str, Any]:
    """Networks, noise and a discount for an environment."""
    sizes = spec.observation_size, spec.action_size
    bounded = all(map(math.isfinite, (*spec.action_low, *spec.action_high)))
    return {
        "policy": NetworkPolicy(*sizes, output="tanh" if bounded else "linear"),
        "action_values": EnsembleActionValues(*sizes, size=critics),
        "noise": ColouredNoise(spec.action_size, min(spec.time_limit, LONGEST_STRETCH)),
        "bounds": spec.bounds,
        "gamma": discount_of(spec.time_limit),
    }


def begin(learner: Any, key: PRNGKeyArray) -> ReplayState:
    """Before the first update: targets are copies, of memory too, so that both can be donated."""
    theta_key, w_key = jax.random.split(key)
    theta, w = learner.policy.init(theta_key), learner.action_values.init(w_key)
    targets = jax.tree.map(jnp.array, (theta, w))
    return ReplayState(
        theta,
        w,
        targets[0],
        targets[1],
        ADAM.init(theta),
        ADAM.init(w),
        updates=jnp.asarray(0, dtype=int),
        noise=learner.noise.init(),
    )


def explore(learner: Any, state: ReplayState, observation: Observation) -> Action:
    """mu_theta(s) + sigma e, inside the box: what is carried out is what is remembered."""
    action = learner.policy(state.theta, observation) + learner.sigma * state.noise.value
    return cap(action, learner.bounds)


def roam(learner: Any, state: ReplayState) -> Action:
    """Anywhere in the box with the same probability, correlated in time as exploration is.

    The noise is mapped through its own distribution, from N(0, 1) to U(-1, 1).
    """
    return cap(jax.scipy.special.erf(state.noise.value / 2**0.5), learner.bounds)


def acted(learner: Any, theta: PyTree, observations: Array) -> Float[Array, "batch act"]:
    """mu_theta(s) inside the box, for each s."""
    return jax.vmap(lambda s: cap(learner.policy(theta, s), learner.bounds))(observations)


def smoothed(learner: Any, key: PRNGKeyArray, actions: Array) -> Float[Array, "batch act"]:
    """A + clip(e, -c, c), inside the box; e is drawn for each row and component."""
    noise = smoothing_noise(key, actions, learner.smoothing, learner.most_smoothing)
    return jax.vmap(lambda action: cap(action, learner.bounds))(actions + noise)


def slopes_at(learner: Any, w: PyTree, observations: Array) -> Callable[[Array], Array]:
    """Actions -> grad_a Q_1(s, a), of these observations; from outside the box it leads back.

    There no critic has been, but a user's own policy may go there; one that ends in tanh does not.
    """

    def worth(observation: Observation, action: Action) -> Number:
        legal = cap(action, learner.bounds)
        beyond = jnp.sum((action - legal) ** 2)
        return learner.action_values.first(w, observation, legal) - beyond

    slopes = jax.vmap(jax.grad(worth, argnums=1))
    return lambda actions: slopes(observations, actions)


def info(y: Float[Array, "batch"], value: Float[Array, "batch critics"]) -> ReplayInfo:
    """What an update showed, before it."""
    first = value[:, 0]
    return ReplayInfo(delta=jnp.sqrt(jnp.mean((y - first) ** 2)), value=jnp.mean(first))


def adam(tree: PyTree, gradient: PyTree, moments: Any, alpha: Number) -> tuple[PyTree, Any]:
    """One step of Adam; alpha > 0 is uphill (Kingma and Ba, 2015)."""
    with jax.numpy_dtype_promotion("standard"):  # Optax raises a float to the count of its steps
        step, moments = ADAM.update(gradient, moments)
    return jax.tree.map(lambda x, d: x + alpha * d, tree, step), moments
