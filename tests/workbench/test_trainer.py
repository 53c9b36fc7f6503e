"""`Trainer`: learn, predict, save, load, evaluate, in compiled worlds and in Gymnasium's."""

import dataclasses
import json
import re

import equinox as eqx
import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from slope import Slope

from detpg import environments
from detpg.runs import RunDirectoryError, write_arrays
from detpg.workbench import Config, DivergedError, Trainer, open_run, train_in
from toys import Chain

SMALL = {"policy": "linear", "value": "quadratic", "log_every": 20, "evaluate_every": 20}
LQR = {"time_limit": 20, "evaluation_episodes": 2, "seed": 4, "sigma": 0.5}


def trainer(**changes):
    return Trainer("opdac", "lqr", **SMALL | LQR | changes)


@pytest.fixture(scope="module")
def whole():
    """After 80 steps of two learners."""
    return trainer(seeds=2).learn(80)


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """What one wrote after 40 of the same steps."""
    path = tmp_path_factory.mktemp("saved") / "lqr.first"
    trainer(seeds=2).learn(40).save(path)
    return path.with_name("lqr.first.npz")


def same(one, other):
    jax.tree.map(np.testing.assert_array_equal, one.session.kept, other.session.kept)


def test_two_halves_are_a_whole(whole, saved):
    again = Trainer.load(saved)
    assert again.num_timesteps == 40
    assert again.config == whole.config
    same(again.learn(40), whole)
    assert again.num_timesteps == 80


def test_a_name_with_dots_stays_whole(saved):
    assert [path.name for path in saved.parent.iterdir()] == ["lqr.first.npz"]


def test_one_observation_or_many(whole):
    many = np.random.default_rng(0).normal(size=(5, 2))
    actions, state = whole.predict(many)
    assert actions.shape == (5, 1)
    assert state is None
    for observation, action in zip(many, actions):
        alone, _ = whole.predict(observation)
        assert alone.shape == (1,)
        np.testing.assert_allclose(alone, action, rtol=1e-6)
    np.testing.assert_array_equal(whole.predict(many)[0], actions)
    other, _ = whole.predict(many, seed=1)
    assert np.all(other != actions)
    assert whole.predict([1, 2])[0].shape == (1,)


def test_noise_is_that_of_the_behaviour(whole):
    # n draws; the standard error of their deviation is sigma / sqrt(2 n).
    at, draws = np.array([0.1, -0.2]), 400
    mean, _ = whole.predict(at)
    noise = whole.predict(np.tile(at, (draws, 1)), deterministic=False)[0] - mean
    assert abs(np.std(noise) - 0.5) < 4 * 0.5 / np.sqrt(2 * draws)
    assert not np.array_equal(whole.predict(at, deterministic=False), mean)


@pytest.mark.parametrize("shape", [(3,), (2, 3), (1, 1, 2), ()])
def test_another_shape_is_refused(whole, shape):
    said = f"The observation has shape {shape}: give (2,) or (N, 2)."
    with pytest.raises(ValueError, match=f"^{re.escape(said)}$"):
        whole.predict(np.zeros(shape))


def test_what_is_not_there_is_refused(whole):
    with pytest.raises(ValueError, match=r"^seed = 2 is not usable: give 0 to 1\.$"):
        whole.predict(np.zeros(2), seed=2)
    with pytest.raises(ValueError, match=r"^total_timesteps = 0 is not usable: give 1 or more\.$"):
        whole.learn(0)
    with pytest.raises(ValueError, match=r"^episodes = 0 is not usable: give 1 or more\.$"):
        whole.evaluate(0)


def test_it_is_judged_by_episodes_of_its_own(whole):
    before = jax.tree.map(np.asarray, whole.session.kept)
    mean, deviation = whole.evaluate(episodes=2)
    jax.tree.map(np.testing.assert_array_equal, whole.session.kept, before)
    played = whole.session.engine.play(whole.session.learners, 2, 4)
    np.testing.assert_allclose([mean, deviation], [played.returns.mean(), played.returns.std()])
    assert played.lengths.tolist() == [[20, 20]] * 2


def test_one_that_is_stopped_and_alone_learns_what_it_learns_among_others(whole):
    alone, seen = trainer(), []

    def callback(interval):
        seen.append(interval.step)
        return len(seen) < 2

    assert alone.learn(100, callback).num_timesteps == 40
    assert seen == [20, 40]
    alone.learn(40)
    # Alone it is compiled as another program: equal to rounding.
    learners = alone.session.learners, whole.session.learners
    for one, both in zip(*map(jax.tree.leaves, learners), strict=True):
        np.testing.assert_allclose(one[0], both[0], rtol=1e-4, atol=1e-6)
    theta = whole.session.learners.learner.learner.theta
    assert np.any(theta[0] != theta[1])


def test_it_says_when_it_diverges():
    wild = trainer(alpha_w=1e6, alpha_theta=1e6, normalise="none")
    with pytest.raises(DivergedError, match=r"^The run diverged: the .* of step \d+ is not finite"):
        wild.learn(100)


class Gain:
    """A policy of one's own: a = theta x."""

    def init(self, key):
        return jnp.full(1, 0.5)

    def __call__(self, theta, observation):
        return theta * observation[:1]


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A Gymnasium world from a function, two worlds, one's own policy; and where it was saved."""
    path = tmp_path_factory.mktemp("own") / "own.npz"
    settings = {"num_envs": 2, "evaluation_episodes": 2, "log_every": 20, "evaluate_every": 20}
    made = Trainer("copdac-q", lambda: Slope(), policy=Gain(), value="quadratic", **settings)
    made.learn(20).save(path)
    return made, path


def test_ones_own_world_and_policy(own):
    made, path = own
    again = Trainer.load(path, environment=Slope, policy=Gain())
    jax.tree.map(np.testing.assert_array_equal, again.session.learners, made.session.learners)
    seen = np.array([[5.0, 0.0], [0.3, 0.5], [-5.0, 1.0]])
    actions, _ = made.predict(seen)
    np.testing.assert_array_equal(again.predict(seen)[0], actions)
    assert actions.min() >= -1.0
    assert actions.max() <= 3.0
    mean, _ = made.evaluate(episodes=2)
    assert -20 < mean < 0
    with pytest.raises(ValueError, match=r"^total_timesteps = 3 is no multiple of 2, the steps"):
        made.learn(3)


def test_code_is_never_loaded(own):
    _, path = own
    with pytest.raises(ValueError, match=r"with a policy of your own: give it again, for code is"):
        Trainer.load(path, environment=Slope)


def test_it_is_refused_by_another_world(own):
    _, path = own
    with pytest.raises(ValueError, match=r"was written by a learner of other sizes: give the env"):
        Trainer.load(path, environment=lambda: gymnasium.make("Pendulum-v1"), policy=Gain())


def test_a_record_of_this_library_is_a_world():
    chain = Trainer("opdac", Chain(), **SMALL, normalise="none", evaluation_episodes=2).learn(20)
    # 0 -> 1 -> 2 -> 3, whatever it does: 1 + 2 + 3
    assert chain.evaluate(episodes=3) == (6.0, 0.0)


class Keyed(eqx.Module):
    """A world of one's own whose state remembers a key."""

    inner: environments.LQR = eqx.field(default_factory=environments.LQR)

    @property
    def spec(self):
        return dataclasses.replace(self.inner.spec, time_limit=10)

    def initial(self, key):
        return key, self.inner.initial(key)

    def transition(self, key, state, action):
        return jax.random.fold_in(state[0], 1), self.inner.transition(key, state[1], action)

    def reward(self, state, action, next_state):
        return self.inner.reward(state[1], action, next_state[1])

    def terminated(self, state):
        return self.inner.terminated(state[1])

    def observe(self, state):
        return self.inner.observe(state[1])


def test_a_world_with_a_key_in_its_state_is_kept(tmp_path):
    options = {**SMALL, "evaluation_episodes": 2}
    whole = Trainer("opdac", Keyed(), **options).learn(40)
    Trainer("opdac", Keyed(), **options).learn(20).save(tmp_path / "half")
    again = Trainer.load(tmp_path / "half", Keyed()).learn(20)
    jax.tree.map(np.testing.assert_array_equal, again.session.learners, whole.session.learners)


def test_a_run_in_ones_own_world_is_opened_with_it(tmp_path):
    config = Config("opdac", "Keyed", **SMALL, normalise="none", steps=20, checkpoint_every=20)
    train_in(tmp_path / "run", config, world=Keyed())
    played = open_run(tmp_path / "run", world=Keyed()).play("last", episodes=3)
    assert played["length"].to_pylist() == [10] * 3


def test_files_that_are_no_trainers_are_refused(tmp_path, saved):
    content = saved.read_bytes()
    about = {"algorithm": "opdac", "environment": "lqr", "policy": "auto", "options": {}}
    (tmp_path / "cut.npz").write_bytes(content[: len(content) // 2])
    (tmp_path / "text.npz").write_text("hello")
    write_arrays(tmp_path / "foreign.npz", {"weights": np.zeros(3)})
    write_arrays(tmp_path / "words.npz", {"config": np.asarray("no JSON"), "step": 1})
    write_arrays(tmp_path / "list.npz", {"config": np.asarray("[1]"), "step": 1})
    write_arrays(tmp_path / "stepless.npz", {"config": np.asarray(json.dumps(about))})
    for name in ("cut", "text", "foreign", "words", "list", "stepless", "nowhere"):
        with pytest.raises(RunDirectoryError, match=rf"{name}\.npz is missing or no trainer's"):
            Trainer.load(tmp_path / name)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"sigm": 0.1}, r"^'sigm' is no setting of a run: leave it out\.$"),
        ({"tiles": "many"}, r"^tiles = 'many' is no whole number"),
        ({"num_envs": 2}, r"^num_envs = 2 is not usable with 'lqr', which is compiled whole"),
        ({"policy": "huge"}, r"^policy 'huge' is unknown"),
    ],
)
def test_what_cannot_be_is_refused(given, said):
    with pytest.raises(ValueError, match=said):
        trainer(**given)


def test_batches_have_to_fit():
    with pytest.raises(
        ValueError, match=r"takes batches of \d+ one-step episodes of a bandit, but"
    ):
        Trainer("bandit-copdac", "lqr")
    odd = {"log_every": 3, "evaluate_every": 3, "checkpoint_every": 3}
    with pytest.raises(ValueError, match=r"^log_every = 3 is no multiple of \d+, the steps that"):
        Trainer("bandit-copdac", "bandit", environment_options={"m": 2}, **odd)
