"""Expected updates: the learners' own, against matrices written out."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg import trees
from detpg.algorithms import COPDACQ
from detpg.policies import LinearPolicy
from detpg.theorems.enumerated import (
    BAIRD_THETA,
    BAIRD_V,
    baird,
    expected_update,
    moments,
    mspbe,
    mspbe_minimiser,
    ring_off_policy,
    stationary,
)
from detpg.theorems.gradient_q import ALGORITHMS, RING_THETA, growth, mean_map
from detpg.theorems.worlds import Linear
from detpg.types import Bounds

GAMMA, STEP = 0.9, 0.1
SIZES = {"COPDAC-Q": 16, "COPDAC-GQ, printed": 24, "COPDAC-GQ, full": 32}


@pytest.fixture
def star(x64):
    return baird()


def test_the_star_is_what_baird_drew(star):
    assert float(star.weights.sum()) == pytest.approx(1)
    values = star.transitions.observation @ jnp.asarray(BAIRD_V)
    assert sorted({float(v) for v in values}) == [3.0, 12.0]
    np.testing.assert_allclose(star.transitions.observation @ BAIRD_THETA, 1.0)
    # Every state is visited and entered alike: the behaviour keeps its own distribution.
    for seen in (star.transitions.observation, star.transitions.next_observation):
        where = np.argmax(np.asarray(seen) @ np.diag([1, 1, 1, 1, 1, 1, 3, 0]), axis=1)
        visited = np.bincount(where, weights=star.weights, minlength=7)
        np.testing.assert_allclose(visited, 1 / 7)


@pytest.mark.parametrize("name", ALGORITHMS)
def test_the_mean_update_is_the_matrix_written_out(star, name: str):
    algorithm, options = ALGORITHMS[name]
    steps = dict.fromkeys(("alpha_w", "alpha_v"), STEP)
    steps |= {"alpha_u": STEP} if "GQ" in name else {}
    parts = LinearPolicy(8, 1), Linear(8), Bounds.unbounded(1)
    learner = algorithm(*parts, gamma=GAMMA, alpha_theta=0.0, **steps, **options)
    start = learner.init(jax.random.key(0))
    weights = [field for field in ("w", "v", "u", "z") if hasattr(start, field)]
    size = SIZES[name]

    def mapped(vector):
        parts = trees.like([getattr(start, field) for field in weights], vector)
        state = eqx.tree_at(
            lambda s: [s.theta, *(getattr(s, field) for field in weights)],
            start,
            [jnp.asarray(BAIRD_THETA)[None], *parts],
        )
        after = expected_update(learner, star, state)
        return trees.to_vector([getattr(after, field) for field in weights])

    found = np.asarray(jax.jit(jax.jacobian(mapped))(jnp.zeros(8 * len(weights))))
    expected = mean_map(name, moments(star, BAIRD_THETA, GAMMA), GAMMA, STEP)
    np.testing.assert_allclose(found[:size, :size], expected, atol=1e-14)


def test_the_minimiser_has_no_slope(x64):
    world, experience = ring_off_policy(jnp.asarray(RING_THETA)[None], 0.6, 0.7)
    known = moments(experience, RING_THETA, world.gamma)
    best = mspbe_minimiser(known)
    for nudge in 1e-3 * np.eye(best.size):
        sides = mspbe(known, np.stack([best + nudge, best, best - nudge]))
        assert sides[0] > sides[1] < sides[2]
        assert sides[0] == pytest.approx(sides[2], rel=1e-9)


def test_a_chain_keeps_its_distribution():
    kernel = np.random.default_rng(0).dirichlet(np.ones(4), size=4)
    kept = stationary(kernel)
    np.testing.assert_allclose(kept @ kernel, kept, atol=1e-14)
    assert kept.sum() == pytest.approx(1)


def test_growth_is_the_rate_of_powers():
    matrix = np.array([[1.1, 1.0], [0.0, 0.5]])
    late = np.linalg.norm(np.linalg.matrix_power(matrix, 200))
    earlier = np.linalg.norm(np.linalg.matrix_power(matrix, 100))
    assert growth(matrix) == pytest.approx(np.log(late / earlier) / 100)


def test_the_learners_are_the_library_s():
    assert ALGORITHMS["COPDAC-Q"][0] is COPDACQ
