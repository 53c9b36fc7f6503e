import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.environments import LQR, PuddleWorld, ScaledActions, TimeLimited
from detpg.testing import check_environment
from toys import Chain

KEY = jax.random.key(0)


class Lopsided(Chain):
    """Earns what was done; actions from -1 to 3 and from 0 to 10."""

    @property
    def spec(self):
        bounds = {"action_size": 2, "action_low": (-1.0, 0.0), "action_high": (3.0, 10.0)}
        return dataclasses.replace(super().spec, **bounds)

    def reward(self, state, action, next_state):
        return action[0] + 100 * action[1]


@pytest.mark.parametrize(
    ("action", "legal"),
    [((-1, -1), (-1, 0)), ((1, 1), (3, 10)), ((0, 0), (1, 5)), ((2, -2), (5, -5))],
)
def test_the_map_is_affine_and_goes_on_beyond_the_bounds(action, legal):
    world = ScaledActions(Lopsided())
    action = jnp.asarray(action, dtype=float)
    assert world.legal(action).tolist() == list(legal)
    state = world.initial(KEY)
    assert float(world.reward(state, action, state)) == legal[0] + 100 * legal[1]


def test_a_unit_is_the_bound_and_the_environment_still_cuts_off():
    plain, scaled = PuddleWorld(), ScaledActions(PuddleWorld())
    state = plain.initial(KEY)
    for ours, theirs in [((1.0, -0.5), (0.05, -0.025)), ((9.0, -9.0), (0.05, -0.05))]:
        np.testing.assert_allclose(
            scaled.transition(KEY, state, jnp.asarray(ours)),
            plain.transition(KEY, state, jnp.asarray(theirs)),
            rtol=1e-6,
        )
    bounds = (scaled.spec.action_low, scaled.spec.action_high)
    assert bounds == ((-1.0, -1.0), (1.0, 1.0))
    assert scaled.spec.observation_high == plain.spec.observation_high


def test_it_keeps_the_protocol():
    check_environment(ScaledActions(PuddleWorld()))
    check_environment(TimeLimited(PuddleWorld(), 7))


def test_a_time_limit_of_ones_own():
    assert TimeLimited(PuddleWorld(), 7).spec.time_limit == 7
    with pytest.raises(ValueError, match=r"^time_limit = 0 is not usable: give 1 or more\.$"):
        TimeLimited(PuddleWorld(), 0)


def test_a_component_without_bounds_keeps_its_units():
    world = ScaledActions(LQR())
    assert world.spec == LQR().spec
    action = jnp.asarray([0.3])
    assert jnp.array_equal(world.legal(action), action)
