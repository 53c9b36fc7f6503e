"""What does not fit is one sentence when the learner is made: no traceback, no other learner."""

import re

import jax
import jax.numpy as jnp
import pytest

from detpg.algorithms import COPDACGQ, COPDACQ, DAC, OPDAC, BanditStochasticAC, OffPAC, StochasticAC
from detpg.critics import LinearStateValue, MLPActionValue, MLPStateValue, QuadraticActionValue
from detpg.environments import LQR, QuadraticBandit
from detpg.features import QuadraticFeatures
from detpg.policies import LinearPolicy, MLPPolicy
from detpg.types import Bounds, EnvironmentSpec

SPEC = LQR().spec
COMPATIBLE, INCOMPATIBLE = (COPDACQ, COPDACGQ), (DAC, OPDAC)
pytestmark = pytest.mark.usefixtures("unchecked")


def refused(words: str):
    """One sentence, in one line, that has these words in it."""
    return pytest.raises(ValueError, match=rf"^[^\n]*{re.escape(words)}[^\n]*\.$")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: COPDACGQ.create(SPEC, correction="fuller"), "correction 'fuller' is unknown: "),
        (lambda: COPDACGQ.create(SPEC, correction="Full"), "choose one of full, printed"),
        (lambda: StochasticAC.create(SPEC, gradient="Scaled"), "choose one of plain, scaled"),
        (
            lambda: BanditStochasticAC.create(QuadraticBandit(2).spec, actor="q"),
            "choose one of score-times-q, score-times-advantage",
        ),
        (lambda: MLPStateValue(2, activation="relu"), "choose one of tanh, sigmoid"),
        (lambda: MLPPolicy(2, 1, activation="gelu"), "activation 'gelu' is unknown: choose one"),
        (lambda: MLPPolicy(2, 1, output="softmax"), "choose one of linear, tanh, sigmoid"),
    ],
)
def test_a_misspelt_option_chooses_nothing(make, words):
    with refused(words):
        make()


@pytest.mark.parametrize("learner", [*COMPATIBLE, *INCOMPATIBLE, StochasticAC, OffPAC])
def test_a_hyper_parameter_is_one_number(learner):
    with refused("gamma has shape (2,): give one number"):
        learner.create(SPEC, gamma=jnp.asarray([0.5, 0.9]))


@pytest.mark.parametrize("learner", [*COMPATIBLE, OPDAC])
@pytest.mark.parametrize("sigma", [[0.1, 0.2], [[0.1]], []])
def test_a_width_is_one_number_or_one_for_each_component(learner, sigma):
    with refused("sigma has shape "):
        learner.create(SPEC, sigma=jnp.asarray(sigma, dtype=float))
    assert learner.create(SPEC, sigma=jnp.asarray([0.1])).sigma.shape == (1,)
    assert learner.create(SPEC, sigma=0.1).sigma.shape == ()


def test_shapes_are_known_also_where_numbers_are_traced():
    def make(sigma):
        return COPDACQ.create(SPEC, sigma=sigma).sigma

    grid = jnp.ones((3, 1))
    assert jax.vmap(make)(grid).shape == grid.shape
    # JAX adds a line of its own below
    with pytest.raises(ValueError, match=r"^sigma has shape \(3,\), but the actions have 1 comp"):
        jax.jit(make)(jnp.ones(3))
    with pytest.raises(ValueError, match=r"^alpha_w has shape \(3,\): give one number"):
        jax.jit(lambda rate: DAC.create(SPEC, alpha_w=rate).alpha_w)(jnp.ones(3))


@pytest.mark.parametrize("learner", [*COMPATIBLE, OPDAC])
@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        (Bounds((-1.0,), (1.0, 1.0)), "are no box"),
        (Bounds((1.0,), (-1.0,)), "low <= high"),
        (Bounds((float("nan"),), (1.0,)), "are no box"),
        (Bounds.unbounded(2), "length of the bounds is 2, but environment 'lqr' has 1 action"),
    ],
)
def test_bounds_are_a_box_of_the_actions(learner, bounds, words):
    with refused(words):
        learner.create(SPEC, bounds=bounds)


@pytest.mark.parametrize("learner", [StochasticAC, OffPAC])
def test_the_stochastic_learners_have_as_many_components_as_the_world(learner):
    with refused("action_size is 2, but environment 'lqr' has 1 action components"):
        learner.create(SPEC, action_size=2)
    with refused("feature map does not take an observation of shape (2,)"):
        learner.create(SPEC, features=Rows(3))


class Rows:
    """x(s) = M s for a matrix with d columns."""

    def __init__(self, d):
        self.size = d

    def __call__(self, observation):
        return jnp.ones((self.size, self.size)) @ observation


class Returning:
    """A policy, V or Q that returns something else than it should."""

    def __init__(self, result):
        self.result = result

    def init(self, key):
        return jnp.zeros(2)

    def __call__(self, w, *inputs):
        return self.result(w)


PAIR, VECTOR = Returning(lambda w: (w, w)), Returning(lambda w: w)


@pytest.mark.parametrize("learner", [*COMPATIBLE, *INCOMPATIBLE])
@pytest.mark.parametrize(
    ("policy", "words"),
    [
        (LinearPolicy(2, 3), "action has shape (3,), but (1,) is needed"),
        (LinearPolicy(5, 1), "policy does not take an observation of shape (2,)"),
        (PAIR, "policy returns a tuple"),
    ],
)
def test_a_policy_of_other_shapes(learner, policy, words):
    with refused(words):
        learner.create(SPEC, policy=policy)


@pytest.mark.parametrize("learner", COMPATIBLE)
@pytest.mark.parametrize(
    ("value", "words"),
    [
        (VECTOR, "state value has shape (2,), but it must be one number"),
        (PAIR, "state value returns a tuple"),
        (MLPStateValue(3), "state value does not take an observation of shape (2,)"),
        (LinearStateValue(QuadraticFeatures(3)), "does not take an observation"),
    ],
)
def test_a_state_value_of_other_shapes(learner, value, words):
    with refused(words):
        learner.create(SPEC, state_value=value)


@pytest.mark.parametrize("learner", INCOMPATIBLE)
@pytest.mark.parametrize(
    ("value", "words"),
    [
        (VECTOR, "action value has shape (2,), but it must be one number"),
        (QuadraticActionValue(2, 2), "an observation of shape (2,) and an action of shape (1,)"),
        (MLPActionValue(1, 1), "action value does not take an observation"),
    ],
)
def test_an_action_value_of_other_shapes(learner, value, words):
    with refused(words):
        learner.create(SPEC, action_value=value)


class Blind:
    """Q^w(s, a) = w s: it ignores the action."""

    def init(self, key):
        return jnp.zeros(2)

    def __call__(self, w, observation, action):
        return jnp.dot(w, observation)


class Narrow:
    """Flat in a but for actions from 1000 to 1010, where the world's actions are."""

    def init(self, key):
        return {"scale": jnp.zeros(()), "counted": jnp.asarray(3, dtype=int)}

    def __call__(self, w, observation, action):
        return w["scale"] * jnp.clip(action[0], 1000.0, 1010.0)


class Rectified:
    """w max(0, a - 1): flat for most actions of a standard normal."""

    def init(self, key):
        return jnp.zeros(())

    def __call__(self, w, observation, action):
        return w * jnp.maximum(action[0] - 1, 0.0)


@pytest.mark.parametrize("learner", INCOMPATIBLE)
def test_a_q_that_ignores_the_action(learner):
    with refused("does not change with a"):
        learner.create(SPEC, action_value=Blind())


@pytest.mark.parametrize("learner", INCOMPATIBLE)
def test_a_q_that_is_flat_in_places_is_not_refused(learner):
    assert learner.create(SPEC, action_value=Rectified())
    far = EnvironmentSpec("far", 2, 1, (1000.0,), (1010.0,), 10, 0.9)
    assert learner.create(far, action_value=Narrow())
