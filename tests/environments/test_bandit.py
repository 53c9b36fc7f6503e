import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.environments import QuadraticBandit
from detpg.environments.bandit import cost_matrix


def reward_of(bandit, action):
    return bandit.reward(jnp.asarray(False), action, jnp.asarray(True))


@pytest.mark.parametrize("m", [1, 10, 25, 50])
def test_the_mixed_spectrum_is_half_a_tenth_and_half_one(m):
    C = np.asarray(cost_matrix(jax.random.key(3), m, "mixed"), dtype=np.float64)
    expected = [0.1] * (m // 2) + [1.0] * (m - m // 2)
    # float32 rounding of a sum of m terms of size at most 1
    np.testing.assert_allclose(np.linalg.eigvalsh(C), expected, rtol=0, atol=2e-6)
    np.testing.assert_allclose(C, C.T, rtol=0, atol=1e-6)


def test_the_mixed_matrix_is_rotated_and_follows_its_key():
    first, again, other = (cost_matrix(jax.random.key(s), 10, "mixed") for s in (1, 1, 2))
    assert float(jnp.max(jnp.abs(first - jnp.diag(jnp.diag(first))))) > 0.01
    assert jnp.array_equal(first, again)
    assert not jnp.allclose(first, other, atol=0.01)
    assert jnp.array_equal(QuadraticBandit(10).C, cost_matrix(jax.random.key(0), 10, "mixed"))


def test_the_isotropic_matrix_is_a_tenth_of_the_identity():
    np.testing.assert_array_equal(
        QuadraticBandit(3, "isotropic").C, np.float32(0.1) * np.eye(3, dtype=np.float32)
    )


def test_reward_by_hand():
    bandit = QuadraticBandit(
        C=jnp.asarray([[2.0, 1.0], [1.0, 3.0]]), a_star=jnp.asarray([4.0, 4.0])
    )
    # error (1, -2): 2 * 1 + 2 * 1 * (1 * -2) + 3 * 4 = 10
    assert float(reward_of(bandit, jnp.asarray([5.0, 2.0]))) == -10.0


@pytest.mark.parametrize("spectrum", ["mixed", "isotropic"])
def test_cost_is_nought_at_four_and_positive_elsewhere(spectrum):
    bandit = QuadraticBandit(10, spectrum)
    assert float(reward_of(bandit, jnp.full(10, 4.0))) == 0.0
    actions = 4 + jax.random.normal(jax.random.key(0), (20, 10))
    errors = np.sum((np.asarray(actions) - 4) ** 2, axis=1)
    costs = -np.asarray(jax.vmap(lambda a: reward_of(bandit, a))(actions))
    assert np.all(costs > 0.099 * errors)
    assert np.all(costs < 1.001 * errors)


@pytest.mark.usefixtures("x64")
def test_gradient_by_finite_differences():
    bandit = QuadraticBandit(4)
    action = jnp.asarray([1.0, -2.0, 0.5, 3.0])
    # Central differences of a quadratic are exact up to rounding.
    steps = 1e-3 * jnp.eye(4)
    differences = [
        (reward_of(bandit, action + h) - reward_of(bandit, action - h)) / 2e-3 for h in steps
    ]
    gradient = jax.grad(lambda a: reward_of(bandit, a))(action)
    np.testing.assert_allclose(gradient, jnp.stack(differences), rtol=1e-8)
    np.testing.assert_allclose(gradient, -2 * bandit.C @ (action - 4), rtol=1e-12)


def test_an_episode_is_one_step():
    bandit, key = QuadraticBandit(5), jax.random.key(0)
    start = bandit.initial(key)
    assert not bool(bandit.terminated(start))
    assert bool(bandit.terminated(bandit.transition(key, start, jnp.zeros(5))))
    assert bandit.observe(start).tolist() == [1.0]


def test_spec():
    spec = QuadraticBandit(5).spec
    assert (spec.name, spec.observation_size, spec.action_size) == ("bandit", 1, 5)
    assert (spec.action_low, spec.action_high) == ((-np.inf,) * 5, (np.inf,) * 5)
    assert (spec.time_limit, spec.discount) == (1, 1.0)


def test_own_matrix_and_optimum():
    bandit = QuadraticBandit(C=2 * jnp.eye(3), a_star=jnp.asarray([1.0, 2.0, 3.0]))
    assert bandit.spec.action_size == 3
    assert float(reward_of(bandit, jnp.asarray([1.0, 2.0, 4.0]))) == -2.0
    assert QuadraticBandit(C=2 * jnp.eye(3)).a_star.tolist() == [4.0, 4.0, 4.0]


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"m": 0}, r"^m = 0 is not .*: give 1 or more\.$"),
        ({"m": -3}, r"^m = -3 is not .*: give 1 or more\.$"),
        ({"spectrum": "flat"}, r"^spectrum 'flat' is unknown: choose one of mixed, isotropic\.$"),
        (
            {"C": jnp.eye(3), "a_star": jnp.zeros(2)},
            r"^C has shape \(3, 3\) and a_star \(2,\): .*$",
        ),
        ({"C": jnp.ones((3, 2))}, r"^C has shape \(3, 2\) and a_star \(3,\): .*\.$"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(arguments, sentence):
    with pytest.raises(ValueError, match=sentence):
        QuadraticBandit(**arguments)


@pytest.mark.parametrize("C", [[[1.0, 0.5], [0.0, 1.0]], [[1.0, 0.0], [0.0, -0.1]]])
def test_a_cost_without_a_least_action_is_refused(C):
    with pytest.raises(ValueError, match="symmetric and positive definite"):
        QuadraticBandit(C=jnp.asarray(C), a_star=jnp.zeros(2))
