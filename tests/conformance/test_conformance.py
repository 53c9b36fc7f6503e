"""Everything in the registries keeps the protocols."""

import jax
import jax.numpy as jnp
import pytest

from detpg import ALGORITHMS, ENVIRONMENTS
from detpg.algorithms import DDPG, TD3
from detpg.testing import check_algorithm, check_environment
from toys import Chain, Recorder, ShortLQR

SMALL = {"memory": 64, "batch": 4, "warm_up": 3}
# A step of it spreads the rounding of single precision beyond what the check allows.
DOUBLE = {"octopus-arm"}


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_environments(name):
    with jax.enable_x64(name in DOUBLE):
        check_environment(ENVIRONMENTS[name](), jax.random.key(1))


@pytest.mark.parametrize("name", ALGORITHMS)
def test_algorithms(name):
    bandit = ENVIRONMENTS["bandit"](3)
    small = SMALL if ALGORITHMS[name] in (DDPG, TD3) else {}
    check_algorithm(ALGORITHMS[name].create(bandit.spec, **small), bandit, jax.random.key(1))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["copdac-gq", "opdac"])
def test_algorithms_on_episodes_that_a_time_limit_cuts(name):
    """With two actions, and correlated noise of a width for each."""
    world, noise = ShortLQR(B=jnp.eye(2)), {"sigma": jnp.asarray([0.1, 0.2]), "correlation": 0.5}
    check_algorithm(ALGORITHMS[name].create(world.spec, **noise), world, jax.random.key(1))


def test_one_that_learns_at_every_step_of_a_longer_episode():
    check_environment(Chain())
    check_algorithm(Recorder(), Chain(length=3))
