"""Worlds in which policies are judged: they end, and what is not finite there is told."""

import re

import gymnasium
import numpy as np
import pyarrow.parquet as pq
import pytest
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from detpg.integrations.gymnasium.worlds import open_worlds
from detpg.workbench import Config, WorldError, judged, train_in
from detpg.workbench.judged import Judged

SMALL = {"policy": "linear", "value": "quadratic", "log_every": 10, "evaluate_every": 10}
SMALL |= {"evaluation_episodes": 1, "normalise": "none"}


class Walk(gymnasium.Env):
    """Observes [step, 0.5], earns 1; ends after `length` steps, never if that is 0.

    `odd` has what is returned or raised instead: (episode, step) -> (observation, reward).
    """

    observation_space = Box(-np.inf, np.inf, (2,))
    action_space = Box(-1.0, 1.0, (1,))
    length, odd = 0, {}

    def __init__(self):
        self.episode = -1

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps, self.episode = 0, self.episode + 1
        return self.seen(0.0)[0], {}

    def step(self, action):
        self.steps += 1
        seen, reward = self.seen(1.0)
        return seen, reward, self.steps == self.length, False, {}

    def seen(self, reward):
        usual = np.array([self.steps, 0.5], np.float32), reward
        found = self.odd.get((self.episode, self.steps), usual)
        if isinstance(found, Exception):
            raise found
        return found


def walk(length, odd=None, kind="Walk"):
    return type(kind, (Walk,), {"length": length, "odd": odd or {}})


def played(worlds, steps, new=False):
    """Rewards, truncations and lengths of episodes in the first world."""
    worlds = Judged(worlds, new)
    worlds.reset([0] * worlds.num)
    seen = [worlds.step(np.zeros((worlds.num, 1))) for _ in range(steps)]
    return [float(s.reward[0]) for s in seen], [bool(s.truncated[0]) for s in seen]


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(judged, "LONGEST", 4)


def test_a_world_that_shows_no_end_is_refused_at_once(short):
    said = (
        "An episode of 'Walk' did not end in 4 steps, and no time limit is known: give one "
        "(--time-limit N), or train without evaluations (--evaluation-episodes 0)."
    )
    with pytest.raises(ValueError, match=f"^{re.escape(said)}$"):
        played(open_worlds(walk(0)), 9, new=True)


def test_one_that_was_judged_before_is_cut_and_that_is_told(short):
    said = r"^An episode of 'Walk' did not end in 4 steps and is cut there, for no time limit is"
    with pytest.warns(UserWarning, match=said):
        rewards, cut = played(open_worlds(walk(0)), 9)
    assert cut == [False, False, False, True] * 2 + [False]
    assert rewards == [1.0] * 9


@pytest.mark.parametrize(("length", "limit"), [(3, None), (9, 9), (4, None)])
def test_one_that_ends_or_has_a_limit_is_left_alone(short, length, limit):
    # A true end in the last step that is waited for, and a limit that is longer than that.
    assert played(open_worlds(walk(length), time_limit=limit), 8, new=True)[0] == [1.0] * 8


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_vector_environment_without_an_end_is_refused(short, mode):
    worlds = open_worlds(SyncVectorEnv([walk(0)] * 2, autoreset_mode=mode))
    with pytest.raises(
        ValueError, match=r"and a vector environment cannot be told to cut it: make"
    ):
        played(worlds, 9)


NAN = np.array([2.0, np.nan], np.float32)
ODD = {
    "reward": ({(0, 2): (np.zeros(2, "f"), np.inf)}, "a reward of inf, at step 2 of"),
    "observation": ({(0, 2): (NAN, 1.0)}, "nan as component 1 of the observation, at step 2 of"),
    "start": ({(0, 0): (NAN, 0.0)}, "nan as component 1 of the observation, at the start of"),
}


@pytest.mark.parametrize("what", ODD)
def test_an_episode_with_what_is_not_finite_has_no_return(what):
    odd, words = ODD[what]
    said = f"The world 'Walk' returned {words} an evaluation episode: the return of that episode"
    with pytest.warns(UserWarning, match=f"^{re.escape(said)}"):
        rewards, _ = played(open_worlds(walk(3, odd)), 6)
    assert np.isnan(rewards[2])  # the episode's sum is none
    assert rewards[3:] == [1.0] * 3


@pytest.mark.parametrize("mode", [None, *AutoresetMode])
def test_the_last_observation_of_a_true_end_is_nobodys(mode):
    made = walk(3, {(0, 3): (NAN, 1.0)})
    vector = mode and SyncVectorEnv([made], autoreset_mode=mode)
    rewards, _ = played(open_worlds(vector or made), 6)
    assert np.all(np.isfinite(rewards))


def test_only_the_seed_whose_world_returned_it_is_lost(tmp_path):
    number = iter(range(9))

    def make():
        # Of two worlds that train and two that judge, the second one breaks.
        odd = {(1, 2): (np.zeros(2, "f"), np.nan)} if next(number) == 1 else {}
        return walk(5, odd)()

    told = []
    config = Config("opdac", "Walk", seeds=2, steps=20, checkpoint_every=10, **SMALL)
    train_in(tmp_path, config, world=make, report=lambda progress: told.extend(progress.messages))
    assert [words for words in told if "lost" in words] == [
        "seed 1: lost, the world returned what is not finite, as the reward of step 7."
    ]


def test_a_run_whose_last_evaluation_failed_is_judged_when_it_goes_on(tmp_path):
    number = iter(range(9))

    def make():
        # The second world judges; it has begun a second episode when the last evaluation begins.
        return walk(5, {(2, 1): OSError("no link")} if next(number) == 1 else {})()

    config = Config("opdac", "Walk", steps=10, checkpoint_every=10, **SMALL)
    with pytest.raises(WorldError) as raised:
        train_in(tmp_path / "run", config, world=make)
    assert str(raised.value) == (
        "The world 'Walk' raised OSError in step, at step 1 of an evaluation episode: no link. The "
        "last good checkpoint is 10: once the world is mended, call train_in again with it."
    )
    train_in(tmp_path / "run", config, world=make)
    table = pq.read_table(tmp_path / "run" / "evaluations.parquet").to_pylist()
    assert [(row["step"], row["return"]) for row in table] == [(0, 5.0), (10, 5.0)]
