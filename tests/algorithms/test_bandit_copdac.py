import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from batches import batch_of, reward_gradient, update
from detpg import begin, greedy_return, train
from detpg.algorithms import BanditCOPDAC
from detpg.algorithms.bandit_copdac import BanditCOPDACState
from detpg.environments import QuadraticBandit
from detpg.trees import to_vector

M = 3
KEY = jax.random.key(0)


def learner(**options):
    return BanditCOPDAC.create(QuadraticBandit(M).spec, **options)


def slope_and_bias(theta, transition):
    """Least squares of the rewards on (a - theta, 1), in NumPy."""
    phi = np.asarray(transition.action, dtype=np.float64) - np.asarray(theta, dtype=np.float64)
    design = np.column_stack([phi, np.ones(len(phi))])
    solution = np.linalg.lstsq(design, np.asarray(transition.reward, dtype=np.float64))[0]
    return solution[:-1], solution[-1]


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("sigma", [1.0, 1e-3])
def test_an_update_is_a_regression_and_a_step_up_its_slope(sigma):
    theta = jnp.asarray([1.0, -2.0, 6.0])
    algorithm = learner(alpha_theta=0.3, sigma=sigma)
    transition = batch_of(algorithm, QuadraticBandit(M), BanditCOPDACState(theta), KEY)
    state, info = update(algorithm, BanditCOPDACState(theta), transition)
    w, bias = slope_and_bias(theta, transition)
    np.testing.assert_allclose(info.slope, w, rtol=1e-8)
    np.testing.assert_allclose(info.value, bias, rtol=1e-10)
    np.testing.assert_allclose(state.theta, theta + 0.3 * w, rtol=1e-8)


def test_actions_are_drawn_around_theta_with_width_sigma():
    algorithm, state = learner(sigma=0.2), BanditCOPDACState(jnp.asarray([1.0, -2.0, 6.0]))
    keys = jax.random.split(KEY, 10_000)
    actions = jax.vmap(lambda k: algorithm.act(k, state, jnp.ones(1)))(keys)
    errors = np.asarray(actions - state.theta[None, :], dtype=np.float64) / 0.2
    # of unit variance: standard errors 1 / sqrt(n) of the mean, sqrt(2 / n) of the variance
    assert np.all(np.abs(errors.mean(axis=0)) < 4.5 / 100)
    assert np.all(np.abs(errors.var(axis=0) - 1) < 4.5 * np.sqrt(2) / 100)


def test_the_expected_slope_is_the_gradient_of_the_reward():
    # The curvature of the reward is even in the noise, the features odd: no bias at any width.
    bandit, algorithm = QuadraticBandit(M), learner(sigma=0.5)
    state = BanditCOPDACState(jnp.asarray([3.0, 4.5, 5.0]))

    def slope(key):
        transition = batch_of(algorithm, bandit, state, key)
        return update(algorithm, state, transition)[1].slope

    slopes = np.asarray(jax.jit(jax.vmap(slope))(jax.random.split(KEY, 2000)), dtype=np.float64)
    error = slopes.std(axis=0, ddof=1) / np.sqrt(len(slopes))
    assert np.all(np.abs(slopes.mean(axis=0) - reward_gradient(bandit, state.theta)) < 4.5 * error)
    # and the test is sharp enough to tell the gradient from nine tenths of it
    assert np.max(np.abs(reward_gradient(bandit, state.theta)) / error) > 45


def test_batches_have_two_samples_per_dimension():
    assert learner().experience.batch == 2 * M


def test_greedy_is_theta():
    state = BanditCOPDACState(jnp.asarray([1.0, -2.0, 6.0]))
    assert learner().greedy(state, jnp.ones(1)).tolist() == [1.0, -2.0, 6.0]


def transformed(transition, change):
    return eqx.tree_at(lambda t: t.action, transition, change(transition.action))


@pytest.mark.usefixtures("x64")
def test_rotating_and_permuting_actions_rotates_and_permutes_the_update():
    algorithm, theta = learner(), jnp.asarray([1.0, -2.0, 6.0])
    transition = batch_of(algorithm, QuadraticBandit(M), BanditCOPDACState(theta), KEY)
    plain = update(algorithm, BanditCOPDACState(theta), transition)[0].theta
    rotation = jax.random.orthogonal(jax.random.key(4), M)
    permutation = jnp.eye(M)[jnp.asarray([2, 0, 1])]
    for change in (rotation, permutation):
        rotated = transformed(transition, lambda a, change=change: a @ change)
        found = update(algorithm, BanditCOPDACState(theta @ change), rotated)[0].theta
        np.testing.assert_allclose(found, plain @ change, rtol=1e-9)


@given(scale=st.floats(0.1, 10.0), shift=st.floats(-100.0, 100.0))
def test_a_constant_added_to_the_reward_is_no_reason_to_move(scale, shift):
    with jax.enable_x64(True):
        algorithm, state = learner(), BanditCOPDACState(jnp.asarray([1.0, -2.0, 6.0]))
        transition = batch_of(algorithm, QuadraticBandit(M), state, KEY)
        changed = eqx.tree_at(lambda t: t.reward, transition, scale * transition.reward + shift)
        step = update(algorithm, state, transition)[0].theta - state.theta
        found = update(algorithm, state, changed)[0].theta - state.theta
        np.testing.assert_allclose(found, scale * step, rtol=1e-8)


@jax.jit
def run_from(theta, a_star):
    bandit = QuadraticBandit(C=QuadraticBandit(M).C, a_star=a_star)
    algorithm = learner(alpha_theta=0.2)
    start = begin(algorithm, bandit, KEY)
    start = eqx.tree_at(lambda s: s.learner, start, BanditCOPDACState(theta))
    return train(algorithm, bandit, KEY, 10 * 2 * M, start=start)[0].learner.theta


@given(shift=st.lists(st.floats(-10.0, 10.0), min_size=M, max_size=M))
def test_translating_optimum_and_start_translates_the_run(shift):
    with jax.enable_x64(True):
        theta, a_star, d = jnp.zeros(M), jnp.full(M, 4.0), jnp.asarray(shift, dtype=float)
        plain, moved = run_from(theta, a_star), run_from(theta + d, a_star + d)
        assert float(jnp.max(jnp.abs(plain))) > 1.0
        np.testing.assert_allclose(moved - d, plain, rtol=1e-8, atol=1e-8)


def test_a_step_too_large_ends_far_away_without_an_exception():
    bandit = QuadraticBandit(2)
    algorithm = BanditCOPDAC.create(bandit.spec, alpha_theta=1e6)
    state, _ = jax.jit(lambda k: train(algorithm, bandit, k, 4 * 20))(KEY)
    # It may stop at a finite theta, where sigma is below the rounding of theta.
    cost = -greedy_return(algorithm, bandit, KEY, state.learner)
    assert not float(cost) < 1e9


@pytest.mark.parametrize("lost", [np.nan, np.inf])
def test_what_is_not_finite_stays_visible_and_raises_nothing(lost):
    algorithm, state = learner(), BanditCOPDACState(jnp.asarray([1.0, lost, 6.0]))
    transition = batch_of(algorithm, QuadraticBandit(M), state, KEY)
    new, info = update(algorithm, state, transition)
    assert not bool(np.isfinite(to_vector(new)).all())
    assert not bool(np.isfinite(to_vector(info)).all())


def test_it_learns():
    bandit = QuadraticBandit(10)
    algorithm = BanditCOPDAC.create(bandit.spec, sigma=0.01, alpha_theta=0.1)
    state, _ = jax.jit(lambda k: train(algorithm, bandit, k, 10_000))(KEY)
    cost = -greedy_return(algorithm, bandit, KEY, state.learner)
    assert float(cost) < 1e-3


@pytest.mark.parametrize(
    ("name", "bad"),
    [("alpha_theta", -0.1), ("alpha_theta", np.nan), ("sigma", 0.0), ("sigma", np.inf)],
)
def test_bad_hyper_parameters_are_refused(name, bad):
    with pytest.raises(ValueError, match=f"{name} = .* is not usable"):
        learner(**{name: bad})
