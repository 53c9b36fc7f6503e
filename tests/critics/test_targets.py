"""What critics with targets are regressed on, by hand."""

import jax
import jax.numpy as jnp
import numpy as np

from detpg.critics.targets import n_step_target, smoothing_noise
from detpg.experience import Recalled


def test_rewards_and_the_tail_are_discounted_and_what_has_terminated_has_no_tail():
    zeros = jnp.zeros((3, 1))
    rows = Recalled(
        observation=zeros,
        action=zeros,
        rewards=jnp.asarray([[1.0, 2.0, 4.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]]),
        next_observation=zeros,
        terminated=jnp.asarray([False, False, True]),
        steps=jnp.asarray([3, 1, 2]),
    )
    found = n_step_target(rows, jnp.asarray(0.5), jnp.asarray([8.0, 8.0, jnp.nan]))
    np.testing.assert_allclose(found, [1 + 1 + 1 + 1, 1 + 4, 1 + 1])


def test_smoothing_noise_is_clipped_before_anything_is_added():
    noise = smoothing_noise(
        jax.random.key(0), jnp.ones((1_000, 2)), jnp.asarray(1.0), jnp.asarray(0.5)
    )
    assert float(noise.min()) == -0.5
    assert float(noise.max()) == 0.5
    assert len(np.unique(noise[:, 0])) > 300  # each sample has its own
    assert not np.allclose(noise[:, 0], noise[:, 1])
