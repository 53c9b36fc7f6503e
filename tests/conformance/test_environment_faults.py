"""Each thing that the check of an environment looks for is found, and said in one sentence."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.testing import check_environment
from faulty import New, is_traced, off_in_batches
from toys import Chain, ChainState


class Renamed(Chain):
    def transition(self, rng, state, action):
        return state


class Greedier(Chain):
    def reward(self, state, action, next_state, bonus):
        return next_state.position.astype(float)


class Short(Chain):
    def observe(self, state):
        return super().observe(state)[:1]


class Whole(Chain):
    def observe(self, state):
        return jnp.zeros(2, dtype=int)


class ListReward(Chain):
    def reward(self, state, action, next_state):
        return jnp.ones(1)


class FloatTerminated(Chain):
    def terminated(self, state):
        return jnp.zeros(())


class Born(Chain):
    def terminated(self, state):
        return jnp.asarray(True)


class Drifting(Chain):
    def transition(self, key, state, action):
        return ChainState(state.position.astype(float), state.label)


class Weak(Chain):
    def initial(self, key):
        return ChainState(jnp.asarray(0), jnp.asarray(0.5))


class Restless(Chain):
    def transition(self, key, state, action):
        return ChainState(
            state.position + 1, jnp.asarray(np.random.default_rng().normal(), dtype=float)
        )


class Branching(Chain):
    def reward(self, state, action, next_state):
        return jnp.asarray(1.0) if next_state.position > 0 else jnp.asarray(0.0)


class OtherUnderJit(Chain):
    def reward(self, state, action, next_state):
        return jnp.asarray(2.0 if is_traced(state.position) else 1.0, dtype=float)


class OtherUnderVmap(Chain):
    def observe(self, state):
        return jnp.stack([state.position.astype(float), off_in_batches(jnp.sin)(state.label)])


class Made(eqx.Module):
    position: jax.Array
    tag: New = eqx.field(static=True)


class Anew(Chain):
    def initial(self, key):
        return Made(jnp.asarray(0, dtype=int), New())

    def transition(self, key, state, action):
        return Made(state.position + 1, New())

    def observe(self, state):
        return jnp.zeros(2, dtype=float)


class Counting(Chain):
    def observe(self, state):
        object.__setattr__(self, "calls", getattr(self, "calls", 0) + 1)
        return super().observe(state)


@pytest.mark.parametrize(
    ("environment", "found"),
    [
        (
            Renamed,
            r"Renamed.transition takes \(rng, state, action\), but \(key, state, action\)",
        ),
        (Greedier, r"Greedier.reward takes \(state, action, next_state, bonus\), but"),
        (Short, r"observe returned float32\(1,\), but an array of shape \(2,\)"),
        (Whole, r"observe returned int32\(2,\), but an array of shape \(2,\) and kind floating"),
        (ListReward, r"reward returned float32\(1,\), but an array of shape \(\)"),
        (FloatTerminated, r"terminated returned float32\(\), but an array of .* kind bool"),
        (Born, "initial returned a terminated state, but an episode that can begin"),
        (
            Drifting,
            r"transition returned .position float32\[\]; .*, but .position int32\[\]; .label",
        ),
        (Weak, "initial returned weakly typed arrays"),
        (Restless, r"a second call with the same key gave another .*observe after"),
        (Branching, "tracing met TracerBoolConversionError"),
        (OtherUnderJit, "under jax.jit, .*reward.* is off by 1"),
        (OtherUnderVmap, "under jax.vmap over keys, .*observe.* is off by 1"),
        (Anew, "transition returned other static parts, but those of initial"),
        (Counting, "Counting changed while it was used"),
    ],
)
def test_what_is_wrong_with_an_environment_is_said(environment, found):
    with pytest.raises(AssertionError, match=f"^{found}.* was expected: .*[.]$"):
        check_environment(environment())


def test_a_missing_method_is_named():
    class Blind:
        spec, initial, transition, reward, terminated = [lambda self: None] * 5

    with pytest.raises(AssertionError, match=r"^Blind is not an Environment, .*: add observe[.]$"):
        check_environment(Blind())


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"observation_size": 0}, r"sizes \(0, 1\)"),
        ({"action_low": (-1.0, -1.0)}, r"lengths of the bounds \(2, 1\), but 1,"),
        ({"action_low": (2.0,)}, r"bounds \(\(2.0,\), \(1.0,\)\), but action_low <= action_high"),
        ({"time_limit": 0}, "time_limit 0, but at least 1"),
        ({"discount": 1.5}, "discount 1.5, but a number from 0 to 1"),
        ({"discount": -0.1}, "discount -0.1, but a number from 0 to 1"),
    ],
)
def test_what_is_wrong_with_a_spec_is_said(changes, found):
    class Misdescribed(Chain):
        @property
        def spec(self):
            return dataclasses.replace(Chain().spec, **changes)

    with pytest.raises(AssertionError, match=f"^spec has {found}.* was expected: .*[.]$"):
        check_environment(Misdescribed())
