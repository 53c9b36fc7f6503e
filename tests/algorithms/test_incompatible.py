"""DAC and OPDAC: hand numbers, and what they learn on the LQR."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.algorithms import COPDACGQ, COPDACQ, DAC, OPDAC
from detpg.algorithms.dac import DACState
from detpg.algorithms.opdac import OPDACState
from detpg.critics import MLPActionValue
from detpg.environments import LQR
from detpg.policies import LinearPolicy
from detpg.training import train
from detpg.types import Bounds, Transition
from nonlinear import TwoLayers


class Product:
    """Q^w(s, a) = w0 a s - w1 a^2: grad_a Q = w0 s - 2 w1 a."""

    def init(self, key):
        return jnp.zeros(2)

    def __call__(self, w, observation, action):
        return w[0] * action[0] * observation[0] - w[1] * action[0] ** 2


UNBOUNDED = Bounds.unbounded(1)
PARTS = {
    "policy": LinearPolicy(1, 1),
    "action_value": Product(),
    "gamma": 0.5,
    "alpha_theta": 0.1,
    "alpha_w": 0.01,
}
TRANSITION = Transition(
    observation=jnp.asarray([2.0]),
    action=jnp.asarray([3.0]),
    reward=jnp.asarray(1.0),
    next_observation=jnp.asarray([4.0]),
    next_action=jnp.asarray([5.0]),
    terminated=jnp.asarray(False),
)


@pytest.mark.parametrize("truncated", [False, True])
@pytest.mark.parametrize("terminated", [False, True])
@pytest.mark.parametrize(
    ("learner", "state", "next_action"),
    [
        (DAC(**PARTS), DACState, 5.0),
        (OPDAC(**PARTS, bounds=UNBOUNDED), partial(OPDACState, deviation=jnp.zeros(1)), 2.0),
    ],
)
def test_by_hand(learner, state, next_action, terminated, truncated):
    """theta = 0.5, w = (1, 1). Sarsa uses the a' that was taken, Q-learning mu(s') = 2.

    A terminal state has no value; a time limit leaves s' its own.
    """
    before = state(theta=jnp.asarray([[0.5]]), w=jnp.asarray([1.0, 1.0]))
    ends = {"terminated": jnp.asarray(terminated), "truncated": jnp.asarray(truncated)}
    transition = dataclasses.replace(TRANSITION, **ends)
    after, info = learner.update(jax.random.key(0), before, transition)
    value, next_value = 3 * 2 - 9, next_action * 4 - next_action**2
    delta = 1 + (0.0 if terminated else 0.5 * next_value) - value
    assert float(info.delta) == pytest.approx(delta)
    np.testing.assert_allclose(after.w, [1 + 0.01 * delta * 6, 1 - 0.01 * delta * 9], rtol=1e-6)
    # mu(s) = 1: grad_a Q = 2 - 2 = 0 there, though not at the action taken
    np.testing.assert_allclose(after.theta, [[0.5]], rtol=1e-6)


def test_the_actor_follows_the_slope_at_mu_not_at_the_action():
    before = OPDACState(jnp.asarray([[1.0]]), jnp.asarray([1.0, 1.0]), deviation=jnp.zeros(1))
    learner = OPDAC(**PARTS, bounds=UNBOUNDED)
    after, _ = learner.update(jax.random.key(0), before, TRANSITION)
    # mu(s) = 2: grad_a Q = 2 - 4 = -2, grad mu = s = 2
    np.testing.assert_allclose(after.theta, [[1.0 - 0.1 * 4]], rtol=1e-6)


def test_dac_acts_without_noise():
    world = LQR()
    learner = DAC.create(world.spec)
    state = learner.init(jax.random.key(0))
    observation = jnp.asarray([1.0, -1.0])
    acted = learner.act(jax.random.key(1), state, observation)
    np.testing.assert_array_equal(acted, learner.greedy(state, observation))


@pytest.mark.parametrize("spread", [0.3, 0.6])
def test_opdac_improves_the_regulator(spread: float):
    """The quadratic critic can hold the exact Q of the LQR, whatever the behaviour's width."""
    world = LQR(noise=0.3)
    learner = OPDAC.create(world.spec, alpha_theta=1e-3, alpha_w=0.01, sigma=spread)
    state, _ = train(learner, world, jax.random.key(1), 60_000)
    best = jax.lax.fori_loop(
        0, 500, lambda _, k: k + 0.01 * jax.grad(world.objective)(k), jnp.zeros((1, 2))
    )
    start, end, top = (
        float(world.objective(k)) for k in (jnp.zeros((1, 2)), state.learner.theta, best)
    )
    assert end - start > 0.8 * (top - start)


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("learner_class", [DAC, OPDAC])
def test_any_differentiable_policy_and_critic(learner_class):
    """One update of networks with 2 observations and 3 actions, against explicit Jacobians."""
    keys = jax.random.split(jax.random.key(0), 7)
    policy, critic = TwoLayers(), MLPActionValue(2, 3, 16)
    theta = policy.init(keys[0])
    w = critic.init(keys[1]) | {"output": jax.random.normal(keys[2], (16,))}
    s, next_s = (jax.random.normal(k, (2,)) for k in keys[3:5])
    a, next_a = (jax.random.normal(k, (3,)) for k in keys[5:])
    seen = Transition(s, a, jnp.asarray(0.7), next_s, next_a, jnp.asarray(False))
    parts = {"policy": policy, "action_value": critic, "gamma": 0.9, "alpha_w": 0.02}
    if learner_class is OPDAC:
        learner = OPDAC(**parts, alpha_theta=0.1, bounds=Bounds.unbounded(3))
        before, next_a = OPDACState(theta, w, deviation=jnp.zeros(3)), policy(theta, next_s)
    else:
        learner, before = DAC(**parts, alpha_theta=0.1), DACState(theta, w)
    after, info = learner.update(keys[0], before, seen)

    delta = 0.7 + 0.9 * critic(w, next_s, next_a) - critic(w, s, a)
    np.testing.assert_allclose(info.delta, delta, rtol=1e-12)
    slope = jax.jacfwd(critic, argnums=2)(w, s, policy(theta, s))
    jacobian = jax.jacfwd(policy)(theta, s)
    for name, matrix in jacobian.items():
        step = 0.1 * np.tensordot(slope, matrix, axes=1)
        np.testing.assert_allclose(after.theta[name], theta[name] + step, rtol=1e-10, atol=1e-12)
    for name, gradient in jax.jacfwd(critic)(w, s, a).items():
        expected = w[name] + 0.02 * delta * gradient
        np.testing.assert_allclose(after.w[name], expected, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("learner", [DAC, OPDAC, COPDACQ, COPDACGQ])
@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -1.0])
def test_a_step_size_that_is_not_usable_is_refused(learner, bad):
    with pytest.raises(ValueError, match=r"alpha_w = .* is not usable: give a finite number"):
        learner.create(LQR().spec, alpha_w=bad)


@pytest.mark.parametrize("learner", [DAC, OPDAC, COPDACQ, COPDACGQ])
def test_a_learner_can_be_made_for_each_point_of_a_grid(learner):
    """As a sweep does: inside `jit` and `vmap`, with the step size a traced number."""
    spec = LQR().spec

    def step_size(alpha_theta):
        return learner.create(spec, alpha_theta=alpha_theta).alpha_theta

    grid = jnp.asarray([0.1, 0.2])
    np.testing.assert_array_equal(jax.jit(jax.vmap(step_size))(grid), grid)
