import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg import begin, train
from detpg.algorithms import BanditCOPDAC
from detpg.environments import QuadraticBandit
from detpg.experience import Experience
from toys import Chain, Recorder

KEY = jax.random.key(0)


class InBatches(Recorder):
    @property
    def experience(self):
        return Experience("fresh", batch=4)


@functools.partial(jax.jit, static_argnames=("chain", "steps"))
def run(chain, key, steps, start=None):
    return train(Recorder(), chain, key, steps, start=start)


def played(chain, steps=8, start=None):
    state, log = run(chain, KEY, steps, start)
    return state, jax.tree.map(np.asarray, log.info["transition"])


def test_an_episode_ends_where_it_terminates_and_the_next_one_begins():
    _, seen = played(Chain(length=3))
    assert seen.observation[:, 0].tolist() == [0, 1, 2, 0, 1, 2, 0, 1]
    assert seen.terminated.tolist() == [False, False, True, False, False, True, False, False]
    assert seen.reward.tolist() == [1, 2, 3, 1, 2, 3, 1, 2]


def test_next_observation_is_the_one_before_the_reset():
    _, seen = played(Chain(length=3))
    assert seen.next_observation[:, 0].tolist() == [1, 2, 3, 1, 2, 3, 1, 2]
    np.testing.assert_array_equal(seen.next_observation[:, 1], seen.observation[:, 1])


def test_a_time_limit_cuts_the_episode_without_terminating_it():
    _, seen = played(Chain(length=100, time_limit=4))
    assert seen.observation[:, 0].tolist() == [0, 1, 2, 3, 0, 1, 2, 3]
    assert seen.next_observation[:, 0].tolist() == [1, 2, 3, 4, 1, 2, 3, 4]
    assert not seen.terminated.any()


def test_the_time_limit_counts_from_the_reset():
    _, seen = played(Chain(length=3, time_limit=4))
    assert seen.observation[:, 0].tolist() == [0, 1, 2, 0, 1, 2, 0, 1]


def test_every_reset_draws_a_new_start():
    _, seen = played(Chain(length=2))
    labels = seen.observation[:, 1].tolist()
    assert labels[0::2] == labels[1::2]
    assert len(set(labels)) == 4


def test_next_action_is_drawn_before_learning_and_the_action_after_it():
    _, seen = played(Chain(length=3))
    # Recorder acts within one above its count, which is t before update t
    assert np.floor(seen.next_action[:, 0]).tolist() == [0, 1, 2, 3, 4, 5, 6, 7]
    assert np.floor(seen.action[:, 0]).tolist() == [0, 1, 2, 3, 4, 5, 6, 7]
    # within an episode both have the same noise
    within = [0, 1, 3, 4]
    drawn, executed = seen.next_action[within], seen.action[[i + 1 for i in within]]
    np.testing.assert_allclose(executed, drawn + 1, rtol=1e-6)
    assert seen.next_action[2] % 1 != seen.action[3] % 1


def test_a_time_limit_is_told_to_the_learner():
    _, seen = played(Chain(length=3, time_limit=2))
    assert seen.truncated.tolist() == [False, True] * 4
    _, seen = played(Chain(length=3, time_limit=100))
    assert not seen.truncated.any()
    assert seen.terminated.sum() == 2


def test_every_step_and_every_run_has_its_own_randomness():
    (_, log), (_, other) = (run(Chain(length=3), jax.random.key(seed), 16) for seed in (0, 1))
    assert len(np.unique(log.info["key"], axis=0)) == 16
    # what Recorder adds to its count; an action is drawn again only as the last next_action
    drawn, others = (np.asarray(x.info["transition"].action[:, 0]) % 1 for x in (log, other))
    assert len(np.unique(drawn)) == 16
    assert not np.any(np.isin(drawn, others))


def test_a_resumed_run_is_the_whole_run_to_the_bit():
    # cut in the middle of an episode
    whole, seen = played(Chain(length=3), 16)
    half, before = played(Chain(length=3), 8)
    resumed, after = played(Chain(length=3), 8, start=half)
    assert int(half.step) == 8
    assert jax.tree.all(jax.tree.map(jnp.array_equal, resumed, whole))
    joined = jax.tree.map(lambda a, b: np.concatenate([a, b]), before, after)
    assert jax.tree.all(jax.tree.map(np.array_equal, joined, seen))


def test_a_batch_learner_resumes_to_the_bit_and_counts_environment_steps():
    bandit = QuadraticBandit(2)
    algorithm = BanditCOPDAC.create(bandit.spec)
    whole, log = train(algorithm, bandit, KEY, 24)
    half, _ = train(algorithm, bandit, KEY, 12)
    resumed, _ = train(algorithm, bandit, KEY, 12, start=half)
    assert (int(half.step), int(whole.step)) == (12, 24)
    assert jnp.array_equal(resumed.learner.theta, whole.learner.theta)
    assert log.info.value.shape == (6,)


def test_a_batch_is_that_many_episodes_of_one_learner():
    _, log = train(InBatches(), Chain(length=3, time_limit=1), KEY, 12)
    seen = log.info["transition"]
    assert seen.observation.shape == (3, 4, 2)
    assert seen.observation[..., 0].tolist() == [[0] * 4] * 3
    assert np.floor(seen.action[..., 0]).tolist() == [[0] * 4, [1] * 4, [2] * 4]
    assert len(np.unique(np.asarray(seen.action) % 1)) == 12
    assert len(np.unique(np.asarray(seen.observation[..., 1]))) == 12


def test_the_probe_sees_the_learner_before_each_update():
    state, log = train(Recorder(rate=2.0), Chain(), KEY, 4, probe=lambda learner: learner["count"])
    assert log.probe.tolist() == [0.0, 2.0, 4.0, 6.0]
    assert float(state.learner["count"]) == 8.0


def test_begin_is_where_training_starts():
    start = begin(Recorder(), Chain(), KEY)
    assert (int(start.step), int(start.episode.steps)) == (0, 0)
    assert not any(leaf.weak_type for leaf in jax.tree.leaves(start))
    moved = eqx.tree_at(lambda s: s.episode.action, start, jnp.asarray([9.0]))
    _, seen = played(Chain(length=3), start=moved)
    assert seen.action[0].tolist() == [9.0]


def test_a_batch_learner_on_longer_episodes_is_refused():
    with pytest.raises(
        ValueError, match=r"^A learner with batches of 4 .* time limit is 100: .*\.$"
    ):
        train(InBatches(), Chain(), KEY, 8)


@pytest.mark.parametrize("steps", [0, -4, 6])
def test_steps_that_are_no_multiple_of_the_batch_are_refused(steps):
    with pytest.raises(ValueError, match=rf"^steps = {steps} is not usable: .* multiple of 4, .*$"):
        train(InBatches(), Chain(time_limit=1), KEY, steps)


def test_an_incremental_learner_needs_a_step():
    with pytest.raises(ValueError, match="positive multiple of 1"):
        train(Recorder(), Chain(), KEY, 0)
