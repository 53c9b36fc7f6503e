import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg import greedy_return
from detpg.algorithms import BanditCOPDAC
from detpg.algorithms.bandit_copdac import BanditCOPDACState
from detpg.environments import QuadraticBandit
from toys import Chain, Recorder

KEY = jax.random.key(0)
LEARNER = {"count": jnp.asarray(0.5)}


class Cliff(Chain):
    """Past its end nothing is a number."""

    def reward(self, state, action, next_state):
        past = state.position >= self.length
        return jnp.where(past, jnp.nan, next_state.position.astype(float))


class Echo(Chain):
    """Earns what was done."""

    def reward(self, state, action, next_state):
        return action[0]


def test_on_the_bandit_it_is_minus_the_cost_of_the_mean():
    bandit = QuadraticBandit(C=jnp.asarray([[2.0, 1.0], [1.0, 3.0]]))
    algorithm = BanditCOPDAC.create(bandit.spec, sigma=100.0)
    # error (1, -2): 2 * 1 + 2 * 1 * (1 * -2) + 3 * 4 = 10, whatever the width of the noise
    found = greedy_return(algorithm, bandit, KEY, BanditCOPDACState(jnp.asarray([5.0, 2.0])))
    np.testing.assert_allclose(found, -10.0, rtol=1e-6)


@pytest.mark.parametrize(("length", "limit", "expected"), [(3, 10, 6.0), (10, 3, 6.0), (1, 1, 1.0)])
def test_rewards_are_added_until_termination_or_the_time_limit(length, limit, expected):
    assert float(greedy_return(Recorder(), Chain(length, limit), KEY, LEARNER)) == expected


def test_nothing_counts_after_termination():
    assert float(greedy_return(Recorder(), Cliff(length=3, time_limit=10), KEY, LEARNER)) == 6.0


def test_the_actions_are_greedy():
    assert float(greedy_return(Recorder(), Echo(length=4), KEY, LEARNER)) == 4 * 0.5
