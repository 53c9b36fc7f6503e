"""Worlds that raise, or return what they may not: told as the world's, and nothing is lost."""

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from detpg import Trainer
from detpg.integrations.gymnasium.worlds import open_worlds
from detpg.workbench.config import Config
from detpg.workbench.run import train_in
from detpg.world_error import WorldError

SMALL = {"policy": "linear", "value": "quadratic", "log_every": 10, "evaluate_every": 10}
SMALL |= {"evaluation_episodes": 1}


class Faulty(gymnasium.Env):
    """Five steps an episode; `faults` has what happens in which call, counted over all worlds."""

    observation_space = Box(-1.0, 1.0, (2,))
    action_space = Box(-1.0, 1.0, (1,))
    faults: dict = {}  # noqa: RUF012  (set by each test)
    calls = 0
    seeds: list = []  # noqa: RUF012

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        Faulty.seeds.append(seed)
        self.steps = 0
        return self._happens("reset", (self.seen(), {}))

    def step(self, action):
        self.steps += 1
        Faulty.calls += 1
        usual = self.seen(), -1.0, False, self.steps == 5, {}
        return self._happens(Faulty.calls, self._happens("step", usual))

    def close(self):
        self._happens("close", None)

    def seen(self):
        return np.array([0.1 * self.steps, 0.5], np.float32)

    def _happens(self, when, usual):
        what = Faulty.faults.get(when)
        if isinstance(what, BaseException):
            raise what
        return usual if what is None else what(usual)


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    monkeypatch.setattr(Faulty, "faults", {})
    monkeypatch.setattr(Faulty, "calls", 0)
    monkeypatch.setattr(Faulty, "seeds", [])


def run(path, **changes):
    told = []
    config = Config.from_json(
        {"algorithm": "opdac", "environment": "Faulty", "steps": 40, "checkpoint_every": 10}
        | SMALL
        | changes
    )
    train_in(path, config, world=Faulty, report=lambda progress: told.extend(progress.messages))
    return told


def put(place, value):
    """A step that returns something else in one place."""
    return lambda usual: (*usual[:place], value, *usual[place + 1 :])


@pytest.mark.parametrize("error", [OSError(28, "no link"), ValueError("bad"), KeyError("x")])
def test_what_a_world_raises_is_its_own_with_step_and_checkpoint(tmp_path, error):
    # 5 steps are the first evaluation; training follows, and 5 more after each 10 steps.
    Faulty.faults = {5 + 10 + 5 + 3: error}
    with pytest.raises(WorldError) as raised:
        run(tmp_path / "run")
    said = str(raised.value)
    assert said.startswith(
        f"The world 'Faulty' raised {type(error).__name__} in step, at step 13 of"
    )
    assert "The last good checkpoint is 12" in said
    assert said.endswith("once the world is mended, call train_in again with it.")
    assert raised.value.__cause__ is error
    Faulty.faults = {}
    run(tmp_path / "run")  # goes on, and finishes


def test_one_that_raises_in_an_evaluation_or_at_its_start(tmp_path):
    Faulty.faults = {3: RuntimeError("stuck")}
    with pytest.raises(WorldError, match=r"RuntimeError in step, at step 3 of an evaluation"):
        run(tmp_path / "run")
    Faulty.faults = {"reset": RuntimeError("no start")}
    with pytest.raises(WorldError, match=r"RuntimeError in reset.*No checkpoint is kept"):
        run(tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_what_close_raises_loses_nothing(tmp_path):
    Faulty.faults = {"close": OSError("gone")}
    with pytest.warns(RuntimeWarning, match=r"raised OSError in close: gone\. Nothing is lost\."):
        run(tmp_path / "run")
    assert (tmp_path / "run" / "best.npz").exists()


def test_a_stop_is_no_fault_of_the_world(tmp_path):
    Faulty.faults = {12: KeyboardInterrupt()}
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "run")


def test_a_trainer_goes_on_from_what_was_learnt():
    Faulty.faults = {5 + 3: OSError("no link")}
    trainer = Trainer("opdac", Faulty, **{**SMALL, "evaluation_episodes": 0})
    with pytest.raises(WorldError, match=r"in step, at step 8 of training: no link\.$"):
        trainer.learn(20)
    Faulty.faults = {}
    assert trainer.learn(20).num_timesteps == 27


WRONG = {
    "observation of another shape": (0, np.zeros(1, np.float32), r"an array of shape \(1,\)"),
    "observation in a column": (0, np.zeros((2, 1), np.float32), r"an array of shape \(2, 1\)"),
    "no observation": (0, None, "None instead of numbers"),
    "text": (0, "ab", r"'ab' \(str\) instead of numbers"),
    "reward in an array": (1, np.ones(1), r"the reward was an array of shape \(1,\)"),
    "no reward": (1, None, "the reward was None instead of one number"),
    "reward as text": (1, "1", r"the reward was '1' \(str\)"),
    "complex reward": (1, 1j, r"the reward was 1j \(complex\)"),
    "flag in an array": (2, np.array([True]), r"terminated was an array of shape \(1,\)"),
    "no flag": (3, None, "truncated was None instead of True or False"),
}


@pytest.mark.parametrize("what", WRONG)
@pytest.mark.parametrize("num", [1, 2])
def test_what_is_returned_wrongly_is_told_at_any_step(what, num):
    place, value, words = WRONG[what]
    Faulty.faults = {4: put(place, value)}
    worlds = open_worlds(Faulty, num)
    worlds.reset(range(num))
    for _ in range(3 // num):
        worlds.step(np.zeros((num, 1)))
    with pytest.raises(WorldError, match=f"'Faulty' returned from step what cannot .*{words}"):
        worlds.step(np.zeros((num, 1)))


@pytest.mark.parametrize("mode", list(AutoresetMode)[:2])
def test_vector_environments_too(mode):
    worlds = open_worlds(SyncVectorEnv([Faulty] * 2, autoreset_mode=mode))
    worlds.reset([0, 1])
    Faulty.faults = {3: RuntimeError("stuck")}
    worlds.step(np.zeros((2, 1)))
    with pytest.raises(WorldError, match=r"raised RuntimeError in step: stuck\.$"):
        worlds.step(np.zeros((2, 1)))


def test_other_numbers_of_values_are_the_old_api():
    Faulty.faults = {2: lambda usual: usual[:3] + usual[4:]}
    worlds = open_worlds(Faulty)
    worlds.reset([0])
    worlds.step(np.zeros((1, 1)))
    with pytest.raises(WorldError, match=r"4 values instead of .* API of gym before 0\.26"):
        worlds.step(np.zeros((1, 1)))
    Faulty.faults = {"reset": lambda usual: usual[0]}
    with pytest.raises(WorldError, match=r"an observation alone instead of .* gym before 0\.26"):
        open_worlds(Faulty).reset([0])


def test_right_values_of_other_types_are_taken():
    Faulty.faults = {
        1: lambda usual: ([0.25, 1], np.float64(2), np.bool_(False), np.array(True), {})
    }
    worlds = open_worlds(Faulty)
    worlds.reset([0])
    step = worlds.step(np.zeros((1, 1)))
    assert (step.reward[0], step.terminated[0], step.truncated[0]) == (2, False, True)
    assert step.next_observation.tolist() == [[0.25, 1.0]]


def test_a_member_of_a_dictionary_is_named():
    class Nested(Faulty):
        observation_space = Dict({"place": Box(-1, 1, (2,)), "speed": Box(-1, 1, (1,))})

        def seen(self):
            return {"place": np.zeros(2, "f"), "speed": np.zeros(2, "f")}

    with pytest.raises(WorldError, match=r"observation\['speed'\] was an array of shape \(2,\)"):
        open_worlds(Nested).reset([0])


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (1, float("nan"), "the reward of step 3"),
        (1, float("-inf"), "the reward of step 3"),
        (0, np.array([0.0, np.nan], "f"), "component 1 of the observation, at step 3"),
        (0, np.array([np.inf, 0.0], "f"), "component 0 of the observation, at step 3"),
    ],
)
def test_numbers_that_are_none_are_told_as_the_worlds(tmp_path, place, value, words):
    Faulty.faults = {5 + 3: put(place, value)}
    with pytest.raises(
        WorldError, match=rf"the world returned what is not finite, as {words}\. Let"
    ):
        run(tmp_path / "run")


def test_seeds_fit_in_31_bits():
    for seed in (0, 1, 2**31 - 1):
        trainer = Trainer("opdac", Faulty, seed=seed, **SMALL)
        trainer.learn(10)
        trainer.evaluate(2)
    given = [seed for seed in Faulty.seeds if seed is not None]
    assert len(set(given)) > 3
    assert all(0 <= seed < 2**31 for seed in given)


def test_what_a_memory_was_given_away_for_survives_a_stop():
    settings = {"hidden": (4,), "batch": 2, "warm_up": 5, "evaluation_episodes": 0}
    trainer = Trainer("td3", Faulty, log_every=10, evaluate_every=10, seeds=2, **settings)
    trainer.learn(10)
    Faulty.faults = {20 + 7: KeyboardInterrupt()}
    with pytest.raises(KeyboardInterrupt):
        trainer.learn(10)
    assert trainer.num_timesteps == 13
    trainer.learn(7)
    assert [int(memory.added[0]) for memory in trainer.session.kept.state.memory] == [20, 20]


def test_rows_of_several_steps_end_where_the_host_began_anew():
    """An interrupted episode is no part of the next one."""
    settings = {"hidden": (4,), "batch": 2, "warm_up": 5, "evaluation_episodes": 1, "n": 3}
    trainer = Trainer(
        "td3", Faulty, log_every=3, evaluate_every=3, judge_in_same_world=True, **settings
    )
    trainer.learn(6)
    memory = trainer.session.kept.state.memory[0]
    rows = np.asarray(memory.rows[0][:6])
    assert rows[:, -1].tolist() == [0, 0, 1, 0, 0, 0]  # the evaluation after 3 steps cut it
