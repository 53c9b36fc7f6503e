"""Each thing that the check of an algorithm looks for is found, and said in one sentence."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg import train
from detpg.experience import Experience
from detpg.testing import check_algorithm
from detpg.types import hyper_parameters
from faulty import New, is_traced, off_in_batches
from toys import Chain, Recorder


class GreedyWithKey(Recorder):
    def greedy(self, key, state, observation):
        return jnp.zeros(1)


class Anonymous(Recorder):
    equations: ClassVar[str] = " "


class NoBatch(Recorder):
    @property
    def experience(self):
        return Experience("fresh", batch=0)


class TwoHands(Recorder):
    def act(self, key, state, observation):
        return jnp.zeros(2)


class Widening(Recorder):
    def update(self, key, state, transition):
        return {"count": jnp.zeros(2, dtype=float)}, None

    def greedy(self, state, observation):
        return jnp.zeros(1)


class WeakCount(Recorder):
    def init(self, key):
        return {"count": jnp.asarray(0.0)}

    def update(self, key, state, transition):
        return {"count": jnp.asarray(1.0)}, None


class Moody(Recorder):
    def update(self, key, state, transition):
        return {"count": jnp.asarray(np.random.default_rng().normal(), dtype=float)}, None


class MoodyGreedy(Recorder):
    def greedy(self, state, observation):
        return jnp.asarray(np.random.default_rng().normal(size=1), dtype=float)


class BranchingUpdate(Recorder):
    def update(self, key, state, transition):
        return (state if transition.terminated else dict(state)), None


class OtherUpdateUnderJit(Recorder):
    def greedy(self, state, observation):
        return jnp.full(1, 2.0 if is_traced(observation) else 1.0, dtype=float)


class OtherUpdateUnderVmap(Recorder):
    def update(self, key, state, transition):
        return {"count": off_in_batches(jnp.cos)(state["count"] + self.rate)}, None


class Through(Recorder):
    """It looks beyond the end of an episode."""

    def update(self, key, state, transition):
        return {"count": state["count"] + jnp.mean(transition.next_observation)}, None


class Cut(Recorder):
    """It takes a time limit for the end of the world."""

    def update(self, key, state, transition):
        seen = jnp.where(transition.ended, 0.0, jnp.mean(transition.next_observation))
        return {"count": state["count"] + seen}, None


class Unequal(Recorder):
    tag: New = eqx.field(static=True, default_factory=New)


class Pickled(Recorder):
    def init(self, key):
        return {"count": jnp.zeros((), dtype=float), "key": key}

    def update(self, key, state, transition):
        return state, None


class Half(Recorder):
    def init(self, key):
        return {"count": jnp.zeros((), dtype=float), "short": jnp.zeros((), dtype=jnp.bfloat16)}

    def update(self, key, state, transition):
        return state, None


class Tallying(Recorder):
    def greedy(self, state, observation):
        object.__setattr__(self, "calls", getattr(self, "calls", 0) + 1)
        return super().greedy(state, observation)


@pytest.mark.parametrize(
    ("algorithm", "found"),
    [
        (
            GreedyWithKey,
            r"GreedyWithKey.greedy takes \(key, state, observation\), but \(state, obs",
        ),
        (Anonymous, "Anonymous.equations is empty"),
        (NoBatch, "NoBatch.experience has batches of 0"),
        (TwoHands, r"act returned float32\(2,\), but an array of shape \(1,\)"),
        (Widening, r"update returned \['count'\] float32\[2\], but \['count'\] float32\[\]"),
        (WeakCount, "init returned weakly typed arrays"),
        (Moody, r"a second call with the same key gave another \['greedy'\]"),
        (MoodyGreedy, "a second call with the same key gave another .*greedy"),
        (BranchingUpdate, "tracing met TracerBoolConversionError"),
        (OtherUpdateUnderJit, "under jax.jit, .*greedy.* is off by 1"),
        (OtherUpdateUnderVmap, "under jax.vmap over seeds and hyper-parameters, .*count.* is off"),
        (Through, "another s' where the episode has terminated gave another .*count"),
        (Cut, "s' was not read where a time limit cuts, but bootstrapping"),
        (Unequal, "new hyper-parameters, seeds and copies traced train 2 times, but once"),
        (Pickled, "saving key.* met TypeError"),
        (Half, "saving bfloat16.* met TypeError"),
        (Tallying, "Tallying changed while it was used"),
    ],
)
def test_what_is_wrong_with_an_algorithm_is_said(algorithm, found):
    with pytest.raises(AssertionError, match=f"^{found}.* was expected: .*[.]$"):
        check_algorithm(algorithm(), Chain(length=3))


def test_a_hyper_parameter_that_is_not_validated_is_named(monkeypatch):
    monkeypatch.setattr("toys.check_hyper", lambda record: None)
    with pytest.raises(AssertionError, match=r"^rate = nan met no refusal, but a ValueError"):
        check_algorithm(Recorder(), Chain())


def test_a_refusal_that_does_not_say_what_is_refused(monkeypatch):
    def vague(record):
        if not np.isfinite(record.rate):
            raise ValueError("bad input")

    monkeypatch.setattr("toys.check_hyper", vague)
    with pytest.raises(AssertionError, match=r"^rate = nan met bad input, but .* that names it"):
        check_algorithm(Recorder(), Chain())


def test_a_hyper_parameter_that_is_no_strong_leaf_is_named():
    known = hyper_parameters(Recorder)["rate"]

    class Static(Recorder):
        rate: float = eqx.field(static=True, default=1.0, metadata={"hyper": known})

    class WeakRate(Recorder):
        rate: jax.Array = eqx.field(converter=jnp.asarray, default=1.0, metadata={"hyper": known})

    for algorithm in (Static(), WeakRate()):
        with pytest.raises(AssertionError, match=r"^rate is .*a strongly typed array leaf was exp"):
            check_algorithm(algorithm, Chain())


def test_a_run_that_does_not_resume_where_it_was_is_found(monkeypatch):
    def forgetful(algorithm, environment, key, steps, *, start):
        return train(algorithm, environment, jax.random.fold_in(key, steps), steps, start=start)

    monkeypatch.setattr("detpg.testing.algorithm.train", forgetful)
    with pytest.raises(AssertionError, match=r"^a resumed run gave another .*: keep in the State"):
        check_algorithm(Recorder(), Chain())
