"""From names to learners: what fits together is built, what does not is refused by name."""

import itertools
import re
import typing

import jax
import jax.numpy as jnp
import pytest

from detpg.algorithms import ALGORITHMS
from detpg.critics import MLPStateValue
from detpg.policies import MLPPolicy
from detpg.types import EnvironmentSpec
from detpg.workbench import Config
from detpg.workbench.config import ValueKind
from detpg.workbench.learners import KINDS, bare, learner, parts_of
from detpg.wrappers import Metered, Normalised

SPEC = EnvironmentSpec("toy", 2, 1, (-1.0,), (1.0,), 100, 0.9, (-2.0, 0.0), (2.0, 1.0))
BANDIT = EnvironmentSpec("bandit", 1, 2, (-1.0, -1.0), (1.0, 1.0), 1, 1.0)
GAUSSIAN = ("stochastic-ac", "offpac")
POLICIES = ("auto", *KINDS)
VALUES = typing.get_args(ValueKind)


def config(algorithm, **changes):
    small = {"hidden": (2,), "value_units": 2, "tiles": 2, "tilings": 2}
    return Config(**{"algorithm": algorithm, "environment": "toy"} | small | changes)


def fits(algorithm, policy, value):
    """As the pages say."""
    if algorithm in GAUSSIAN:
        return policy in ("auto", "quadratic", "tiles")
    if algorithm == "dac" and value == "quadratic":
        return policy in ("auto", "mlp")  # what starts at zero would stay there
    if "action_values" in parts_of(ALGORITHMS[algorithm]):
        return value == "mlp"
    return value != "tiles" or "state_value" in parts_of(ALGORITHMS[algorithm])


INCREMENTAL = [name for name in ALGORITHMS if not name.startswith("bandit")]
ALL = [(*one, fits(*one)) for one in itertools.product(INCREMENTAL, POLICIES, VALUES)]


@pytest.mark.parametrize("algorithm", INCREMENTAL)
def test_what_fits_is_built_and_the_rest_is_refused(algorithm):
    for name, policy, value, good in ALL:
        if name != algorithm:
            continue
        given = config(name, policy=policy, value=value)
        if not good:
            odd = policy if algorithm in GAUSSIAN else value
            words = rf"{odd}.*: choose .*\.$|^The policy would never move: .*\.$"
            with pytest.raises(ValueError, match=words):
                bare(given, SPEC, None)
            continue
        built = bare(given, SPEC, None)
        state = jax.eval_shape(built.init, jax.random.key(0))
        action = jax.eval_shape(built.greedy, state, jax.ShapeDtypeStruct((2,), float))
        assert action.shape == (1,)


@pytest.mark.parametrize("name", ["bandit-copdac", "bandit-stochastic-ac"])
def test_batch_learners_have_parts_of_their_own(name):
    given = Config(name, "bandit", normalise="both")
    assert type(learner(given, BANDIT)) is ALGORITHMS[name]
    with pytest.raises(ValueError, match=f"^{name} has a policy of its own: leave policy out"):
        learner(Config(name, "bandit", policy="mlp"), BANDIT)


@pytest.mark.parametrize(
    ("normalise", "observations", "rewards"),
    [
        ("none", False, False),
        ("observations", True, False),
        ("rewards", False, True),
        ("both", True, True),
    ],
)
def test_it_is_metered_outside_and_normalised_inside(normalise, observations, rewards):
    options = {"gamma": 0.5}
    built = learner(config("opdac", normalise=normalise, options=options), SPEC)
    assert isinstance(built, Metered)
    if normalise == "none":
        assert isinstance(built.algorithm, ALGORITHMS["opdac"])
        return
    inside = built.algorithm
    assert isinstance(inside, Normalised)
    assert (inside.observations, inside.rewards) == (observations, rewards)
    assert float(inside.gamma) == 0.5


def test_a_network_ends_in_the_box_where_there_is_one():
    mean = bare(config("opdac", policy="mlp", hidden=(3, 2)), SPEC, None).policy
    assert mean == MLPPolicy(2, 1, (3, 2), output="tanh")
    half = EnvironmentSpec("toy", 2, 1, (0.0,), (float("inf"),), 100, 0.9)
    assert bare(config("opdac", policy="mlp"), half, None).policy.output == "linear"


def test_tiles_lie_where_the_learner_sees_observations():
    seen = bare(config("copdac-q", policy="tiles"), SPEC, None).policy.features
    assert (seen.low, seen.high) == ((-3.0, -3.0), (3.0, 3.0))
    raw = bare(config("copdac-q", policy="tiles", normalise="none"), SPEC, None).policy.features
    assert (raw.low, raw.high) == ((-2.0, 0.0), (2.0, 1.0))


class Own:
    """A policy that counts as false."""

    def __len__(self):
        return 0

    def init(self, key):
        return jnp.zeros(2)

    def __call__(self, theta, observation):
        return jnp.atleast_1d(jnp.sum(theta * observation))


def test_ones_own_policy_goes_before_the_kinds():
    mine = Own()
    assert bare(config("copdac-q"), SPEC, mine).policy is mine
    assert bare(config("copdac-q"), SPEC, mine).state_value == MLPStateValue(2, 2)
    with pytest.raises(ValueError, match=r"^offpac has a Gaussian policy that is linear in feat"):
        bare(config("offpac"), SPEC, mine)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"algorithm": "sac"}, "algorithm 'sac' is unknown: choose one of "),
        ({"policy": "big"}, "policy 'big' is unknown: choose one of mlp, linear, tiles, quad"),
        ({"options": {"alpha": 1.0}}, "alpha is no option of opdac: choose from gamma, "),
        ({"options": {"sigma": -1.0}}, "sigma = -1 is not usable: give a finite number between"),
    ],
)
def test_what_does_not_exist_is_refused(given, said):
    with pytest.raises(ValueError, match=f"^{re.escape(said)}"):
        learner(config(**{"algorithm": "opdac"} | given), SPEC)
