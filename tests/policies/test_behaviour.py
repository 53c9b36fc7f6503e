"""The noise of the behaviours: widths, correlation, episodes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.algorithms import OPDAC
from detpg.environments import LQR
from detpg.policies import ConstantPolicy, GaussianBehaviour, cap
from detpg.training import train
from detpg.types import Bounds, Transition

MEAN = jnp.asarray([1.0, -2.0])
OBSERVATION = jnp.ones(1)
NUM_STEPS = 40_000


def noise_of(correlation: float, sigma) -> np.ndarray:
    """a - mu over the steps of one long episode."""
    behaviour = GaussianBehaviour(ConstantPolicy(2), jnp.asarray(sigma), correlation)

    def body(deviation, key):
        action = behaviour.act(key, MEAN, OBSERVATION, deviation)
        return action - MEAN, action - MEAN

    keys = jax.random.split(jax.random.key(1), NUM_STEPS)
    return np.asarray(jax.lax.scan(body, jnp.zeros(2), keys)[1], dtype=np.float64)


@pytest.mark.parametrize("correlation", [0.0, 0.8])
def test_each_component_has_its_width_and_the_noise_its_correlation(correlation: float):
    sigma = np.array([0.5, 2.0])
    unit = noise_of(correlation, sigma)[100:] / sigma
    # the mean of a correlated series has (1 + c) / (1 - c) times the variance of a white one
    error = 4.5 * np.sqrt((1 + correlation) / (1 - correlation) / len(unit))
    assert np.all(np.abs(unit.mean(axis=0)) < error)
    # the variance of a sample variance, 2 sum_k c^(2k) / n, is 2 (1 + c^2) / (1 - c^2) / n
    spread = 4.5 * np.sqrt(2 * (1 + correlation**2) / (1 - correlation**2) / len(unit))
    assert np.all(np.abs((unit**2).mean(axis=0) - 1) < spread)
    lagged = (unit[1:] * unit[:-1]).mean(axis=0)
    assert np.all(np.abs(lagged - correlation) < spread)
    assert np.all(np.abs((unit[:, 0] * unit[:, 1]).mean()) < spread)


def test_no_width_is_no_noise_and_has_no_density():
    assert np.all(noise_of(0.5, 0.0) == 0)
    still = GaussianBehaviour(ConstantPolicy(2), jnp.asarray(0.0))
    assert np.isnan(still.log_prob(MEAN, OBSERVATION, MEAN))


def test_noise_has_its_full_width_where_nothing_went_before_and_starts_narrower_from_rest():
    """With correlation 0.8 the first step from 0 has sqrt(1 - 0.64) = 0.6 of the width."""
    behaviour = GaussianBehaviour(ConstantPolicy(2), jnp.asarray(0.5), 0.8)
    key = jax.random.key(3)
    white = GaussianBehaviour(ConstantPolicy(2), jnp.asarray(0.5)).act(key, MEAN, OBSERVATION)
    np.testing.assert_array_equal(behaviour.act(key, MEAN, OBSERVATION), white)
    started = behaviour.act(key, MEAN, OBSERVATION, jnp.zeros(2))
    np.testing.assert_allclose(started - MEAN, 0.6 * (white - MEAN), rtol=1e-5)


def test_the_noise_starts_anew_with_an_episode():
    """With the greatest correlation the noise hardly moves, but for the end of an episode."""
    behaviour = GaussianBehaviour(ConstantPolicy(2), jnp.asarray(1.0), 0.9)
    step = {
        "observation": OBSERVATION,
        "action": MEAN + 3.0,
        "reward": jnp.asarray(0.0),
        "next_observation": OBSERVATION,
        "next_action": MEAN,
    }
    for terminated, truncated, kept in (
        (False, False, 3.0),
        (True, False, 0.0),
        (False, True, 0.0),
    ):
        ends = {"terminated": jnp.asarray(terminated), "truncated": jnp.asarray(truncated)}
        found = behaviour.deviation(MEAN, Transition(**step, **ends))
        np.testing.assert_allclose(found, [kept, kept], rtol=1e-6)


def test_a_learner_explores_with_correlated_noise_around_its_policy():
    """With a fixed actor a - mu is the noise; a cut after 200 steps resets it."""
    world = LQR()
    learner = OPDAC.create(world.spec, alpha_theta=0.0, alpha_w=0.0, sigma=0.5, correlation=0.9)
    _, log = train(
        learner, world, jax.random.key(2), 20_000, probe=lambda learner: learner.deviation
    )
    before = np.asarray(log.probe[:, 0], dtype=np.float64)
    assert np.all(before[::200] == 0)
    assert np.all(before[1::200] != 0)
    inside = before.reshape(-1, 200)[:, 50:]
    lagged = (inside[:, 1:] * inside[:, :-1]).mean() / (inside**2).mean()
    # of a lag-1 coefficient, sqrt((1 - c^2) / n)
    assert abs(lagged - 0.9) < 4.5 * np.sqrt((1 - 0.81) / inside.size)


def test_a_density_needs_the_width_of_each_component():
    behaviour = GaussianBehaviour(ConstantPolicy(2), jnp.asarray([0.5, 2.0]))
    found = behaviour.log_prob(MEAN, OBSERVATION, MEAN + jnp.asarray([0.5, 4.0]))
    # errors of one and two widths
    assert float(found) == pytest.approx(-0.5 - 2.0 - np.log(2 * np.pi * 0.5 * 2.0), rel=1e-6)


def test_cap_is_the_nearest_legal_action():
    bounds = Bounds((-1.0, -np.inf), (2.0, 0.5))
    assert cap(jnp.asarray([-3.0, -9.0]), bounds).tolist() == [-1.0, -9.0]
    assert cap(jnp.asarray([3.0, 9.0]), bounds).tolist() == [2.0, 0.5]
