import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from batches import batch_of, update
from detpg import train
from detpg.algorithms import BanditStochasticAC
from detpg.algorithms.bandit_stochastic_ac import BanditStochasticACState
from detpg.environments import QuadraticBandit
from detpg.policies import GaussianParameters
from detpg.trees import to_vector

M = 3
KEY = jax.random.key(0)


def learner(**options):
    return BanditStochasticAC.create(QuadraticBandit(M).spec, **options)


def a_state(y=-1.0):
    theta = jnp.asarray([1.0, -2.0, 6.0])
    return BanditStochasticACState(GaussianParameters(theta, jnp.asarray(y, dtype=float)))


def scores(state, transition):
    """grad log N(theta, exp(y) I), by the formula, for each action: (theta, y)."""
    variance = np.exp(float(state.parameters.y))
    error = np.asarray(transition.action) - np.asarray(state.parameters.theta)
    return error / variance, np.sum(error**2, axis=1) / (2 * variance) - M / 2


def direction(algorithm, state, transition):
    new, info = update(algorithm, state, transition)
    moved, old = new.parameters, state.parameters
    theta = (moved.theta - old.theta) / algorithm.alpha_theta
    return np.asarray(theta), np.asarray((moved.y - old.y) / algorithm.alpha_y), info


@pytest.mark.usefixtures("x64")
def test_score_times_q_is_the_batch_mean_of_score_times_reward():
    algorithm, state = learner(alpha_theta=1.0, alpha_y=1.0), a_state()
    transition = batch_of(algorithm, QuadraticBandit(M), state, KEY)
    theta, y, _ = direction(algorithm, state, transition)
    score_theta, score_y = scores(state, transition)
    reward = np.asarray(transition.reward)
    np.testing.assert_allclose(theta, np.mean(score_theta * reward[:, None], axis=0), rtol=1e-9)
    np.testing.assert_allclose(y, np.mean(score_y * reward), rtol=1e-9)


@pytest.mark.usefixtures("x64")
def test_score_times_advantage_leaves_out_the_bias():
    q, state = learner(alpha_theta=1.0, alpha_y=1.0), a_state()
    advantage = dataclasses.replace(q, actor="score-times-advantage")
    transition = batch_of(q, QuadraticBandit(M), state, KEY)
    q_theta, q_y, info = direction(q, state, transition)
    a_theta, a_y, _ = direction(advantage, state, transition)
    score_theta, score_y = scores(state, transition)
    assert abs(float(info.value)) > 1.0
    expected = q_theta - float(info.value) * score_theta.mean(axis=0)
    np.testing.assert_allclose(a_theta, expected, rtol=1e-9)
    np.testing.assert_allclose(a_y, q_y - float(info.value) * score_y.mean(), rtol=1e-9)


@pytest.mark.usefixtures("x64")
def test_the_bias_is_that_of_least_squares_on_the_scores():
    algorithm, state = learner(), a_state()
    transition = batch_of(algorithm, QuadraticBandit(M), state, KEY)
    _, _, info = direction(algorithm, state, transition)
    design = np.column_stack([*scores(state, transition), np.ones(algorithm.experience.batch)])
    solution = np.linalg.lstsq(design, np.asarray(transition.reward))[0]
    np.testing.assert_allclose(info.value, solution[-1], rtol=1e-9)
    np.testing.assert_allclose(info.sigma, np.exp(-0.5), rtol=1e-12)


@pytest.mark.usefixtures("x64")
def test_each_parameter_has_its_own_step_size():
    state = a_state()
    slow, fast = learner(alpha_theta=0.1, alpha_y=0.2), learner(alpha_theta=0.3, alpha_y=0.8)
    transition = batch_of(slow, QuadraticBandit(M), state, KEY)
    new = [update(a, state, transition)[0].parameters for a in (slow, fast)]
    steps = [(p.theta - state.parameters.theta, p.y - state.parameters.y) for p in new]
    np.testing.assert_allclose(steps[1][0], 3 * steps[0][0], rtol=1e-9)
    np.testing.assert_allclose(steps[1][1], 4 * steps[0][1], rtol=1e-9)


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("actor", ["score-times-q", "score-times-advantage"])
def test_a_fixed_variance_is_kept_to_the_bit_while_the_mean_moves(actor):
    state = a_state(y=-0.123456789)
    algorithm = learner(actor=actor, fixed_variance=True, alpha_y=1e3)
    transition = batch_of(algorithm, QuadraticBandit(M), state, KEY)
    new = update(algorithm, state, transition)[0].parameters
    assert np.asarray(new.y).tobytes() == np.asarray(state.parameters.y).tobytes()
    # the critic's features are then the scores of the mean alone
    score_theta, _ = scores(state, transition)
    design = np.column_stack([score_theta, np.ones(algorithm.experience.batch)])
    w = np.linalg.lstsq(design, np.asarray(transition.reward))[0]
    value = design @ w - (w[-1] if actor == "score-times-advantage" else 0.0)
    expected = np.mean(score_theta * value[:, None], axis=0)
    step = (new.theta - state.parameters.theta) / algorithm.alpha_theta
    np.testing.assert_allclose(step, expected, rtol=1e-9)


def test_sigma_is_the_standard_deviation_it_begins_with():
    parameters = learner(sigma=0.1).init(KEY).parameters
    np.testing.assert_allclose(jnp.exp(parameters.y), 0.01, rtol=1e-5)
    assert parameters.theta.tolist() == [0.0] * M


def test_actions_are_drawn_from_the_policy():
    algorithm, state = learner(), a_state(y=float(np.log(0.04)))
    keys = jax.random.split(KEY, 10_000)
    actions = jax.vmap(lambda k: algorithm.act(k, state, jnp.ones(1)))(keys)
    errors = np.asarray(actions - state.parameters.theta[None, :], dtype=np.float64) / 0.2
    # of unit variance: standard errors 1 / sqrt(n) of the mean, sqrt(2 / n) of the variance
    assert np.all(np.abs(errors.mean(axis=0)) < 4.5 / 100)
    assert np.all(np.abs(errors.var(axis=0) - 1) < 4.5 * np.sqrt(2) / 100)


def test_greedy_is_the_mean_and_batches_have_two_samples_per_dimension():
    assert learner().greedy(a_state(), jnp.ones(1)).tolist() == [1.0, -2.0, 6.0]
    assert learner().experience.batch == 2 * M


@pytest.mark.usefixtures("x64")
def test_rotating_actions_rotates_the_mean_and_leaves_the_variance():
    algorithm, state = learner(), a_state()
    transition = batch_of(algorithm, QuadraticBandit(M), state, KEY)
    plain = update(algorithm, state, transition)[0].parameters
    rotation = jax.random.orthogonal(jax.random.key(4), M)
    rotated = eqx.tree_at(lambda t: t.action, transition, transition.action @ rotation)
    turned = GaussianParameters(state.parameters.theta @ rotation, state.parameters.y)
    found = update(algorithm, BanditStochasticACState(turned), rotated)[0].parameters
    np.testing.assert_allclose(found.theta, plain.theta @ rotation, rtol=1e-9)
    np.testing.assert_allclose(found.y, plain.y, rtol=1e-9)


@given(shift=st.floats(-100.0, 100.0))
def test_a_baseline_takes_out_what_is_added_to_every_reward(shift):
    with jax.enable_x64(True):
        state = a_state()
        q, advantage = learner(), learner(actor="score-times-advantage")
        transition = batch_of(q, QuadraticBandit(M), state, KEY)
        shifted = eqx.tree_at(lambda t: t.reward, transition, transition.reward + shift)
        plain, found = (direction(advantage, state, t)[0] for t in (transition, shifted))
        np.testing.assert_allclose(found, plain, rtol=1e-7)
        plain, found = (direction(q, state, t)[0] for t in (transition, shifted))
        expected = shift * scores(state, transition)[0].mean(axis=0)
        np.testing.assert_allclose(found - plain, expected, rtol=1e-7, atol=1e-9)


def test_a_step_too_large_diverges_without_an_exception():
    bandit, algorithm = QuadraticBandit(M), learner(alpha_theta=1e6, alpha_y=1e6)
    state, _ = jax.jit(lambda k: train(algorithm, bandit, k, 2 * M * 10))(KEY)
    assert not bool(np.isfinite(to_vector(state.learner)).all())


@pytest.mark.parametrize(
    ("name", "bad"),
    [("alpha_theta", -0.1), ("alpha_y", np.nan), ("sigma", 0.0), ("sigma", np.inf)],
)
def test_bad_hyper_parameters_are_refused(name, bad):
    with pytest.raises(ValueError, match=f"{name} = .* is not usable"):
        learner(**{name: bad})


@pytest.mark.usefixtures("unchecked")
def test_an_unknown_actor_is_refused_in_one_sentence():
    with pytest.raises(ValueError, match=r"^actor 'q' is unknown: choose one of .*advantage\.$"):
        learner(actor="q")
