"""A learner without noise starts where it can learn, or is refused."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.algorithms import DAC
from detpg.critics import MLPActionValue, QuadraticActionValue
from detpg.environments import LQR, TimeLimited
from detpg.evaluation import greedy_return
from detpg.features import TileCoding
from detpg.features.quadratic import QuadraticFeatures
from detpg.policies import FeaturePolicy, FunctionPolicy, LinearPolicy
from detpg.training import train
from detpg.workbench import Config
from detpg.workbench.learners import learner

SPEC = LQR().spec
SENTENCE = (
    "The policy would never move: all its first actions are 0, and without noise the critic learns "
    "from them no slope in a; give a policy that starts elsewhere, such as MLPPolicy "
    "(--policy mlp), or a critic that is a network, MLPActionValue (--value mlp)."
)
ZERO_AT_FIRST = {
    "linear": LinearPolicy(2, 1),
    "quadratic": FeaturePolicy(QuadraticFeatures(2), 1),
    "tiles": FeaturePolicy(TileCoding((-3.0, -3.0), (3.0, 3.0), (4, 4), num_tilings=2), 1),
    "own": FunctionPolicy(lambda gain, seen: jnp.tanh(gain * seen[:1]), jnp.zeros(1)),
}


@pytest.mark.parametrize("kind", ZERO_AT_FIRST)
def test_a_policy_that_is_zero_at_first_is_refused_with_a_quadratic_critic(kind):
    with pytest.raises(ValueError, match=f"^{re.escape(SENTENCE)}$"):
        DAC.create(SPEC, policy=ZERO_AT_FIRST[kind])
    DAC.create(SPEC, policy=ZERO_AT_FIRST[kind], action_value=MLPActionValue(2, 1, 4))


def test_what_is_refused_never_moves():
    rates = {"alpha_theta": 0.1, "alpha_w": 0.01, "gamma": 0.9}
    stuck = DAC(policy=LinearPolicy(2, 1), action_value=QuadraticActionValue(2, 1), **rates)
    state, _ = jax.jit(lambda key: train(stuck, LQR(noise=0.3), key, 300))(jax.random.key(0))
    assert np.abs(state.learner.theta).max() == 0
    assert np.abs(state.learner.w).max() > 0


def test_dac_as_it_is_made_improves_where_starts_are_random():
    """Random starts and a policy that saturates: the actions tell the critic their slope."""
    world = TimeLimited(LQR(), 10)
    made = DAC.create(world.spec)

    def run(key):
        first = made.init(key)
        last = train(made, world, key, 15_000)[0].learner
        idle = jax.tree.map(jnp.zeros_like, first)
        starts = jax.random.split(jax.random.key(1), 64)
        earned = jax.vmap(greedy_return, in_axes=(None, None, 0, None))
        return [jnp.mean(earned(made, world, starts, state)) for state in (idle, first, last)]

    idle, before, after = jax.jit(jax.vmap(run))(jax.random.split(jax.random.key(0), 3))
    assert np.all(after > before + 2)
    assert np.all(after > idle + 2)


@pytest.mark.parametrize("policy", ["linear", "quadratic", "tiles"])
def test_a_run_of_a_learner_without_noise_is_refused(policy):
    for algorithm, options in (("dac", {}), ("opdac", {"sigma": 0.0})):
        config = Config(algorithm, "lqr", policy=policy, value="quadratic", options=options)
        with pytest.raises(ValueError, match=f"^{re.escape(SENTENCE)}$"):
            learner(config, SPEC)


@pytest.mark.parametrize("name", ["copdac-q", "copdac-gq"])
def test_compatible_features_need_noise(name):
    words = (
        f"sigma = 0 leaves {name} nothing to learn from, since phi(s, a) is 0 at its own actions: "
        "give sigma > 0, or data."
    )
    with pytest.raises(ValueError, match=f"^{re.escape(words)}$"):
        learner(Config(name, "lqr", options={"sigma": 0.0}), SPEC)
    learner(Config(name, "lqr", data="log.parquet", options={"sigma": 0.0}), SPEC)


def test_a_learner_without_noise_is_made_where_it_moves():
    for algorithm, options in (("dac", {}), ("opdac", {"sigma": 0.0})):
        for policy, value in (("auto", "mlp"), ("auto", "quadratic"), ("linear", "mlp")):
            learner(Config(algorithm, "lqr", policy=policy, value=value, options=options), SPEC)
