import jax
import jax.numpy as jnp

from detpg.policies import ConstantPolicy


def test_the_action_is_theta_whatever_is_observed():
    policy, theta = ConstantPolicy(2), jnp.asarray([3.0, -1.0])
    for observation in (jnp.ones(1), -5 * jnp.ones(4)):
        assert policy(theta, observation).tolist() == [3.0, -1.0]


def test_theta_begins_at_nought():
    assert ConstantPolicy(3).init(jax.random.key(0)).tolist() == [0.0, 0.0, 0.0]


def test_policies_are_equal_by_value():
    assert ConstantPolicy(3) == ConstantPolicy(3)
    assert hash(ConstantPolicy(3)) == hash(ConstantPolicy(3))
    assert ConstantPolicy(3) != ConstantPolicy(4)
