"""Worlds that train and worlds that judge: kept apart, or judged in between episodes."""

import functools
import re

import equinox as eqx
import gymnasium
import jax
import numpy as np
import pytest
from gymnasium import wrappers
from gymnasium.vector import SyncVectorEnv
from slope import Slope

from detpg.algorithms import ALGORITHMS
from detpg.figures.measured import read
from detpg.types import EnvironmentSpec
from detpg.workbench import Config, Trainer, open_run, train_in
from detpg.workbench.engines import engine_of

SPEC = EnvironmentSpec("Slope", 2, 1, (-1.0,), (1.0,), 4, 0.9)
SAME = {"judge_in_same_world": True}
SMALL = {"policy": "linear", "value": "quadratic", "log_every": 10, "evaluate_every": 10}
ONE_OBJECT = (
    "Training and evaluations were given one and the same Slope: give a function that builds a new "
    "one at each call, or judge in the one that trains, --judge-in-same-world (in Python "
    "judge_in_same_world=True), or not at all, --evaluation-episodes 0."
)
TWICE = (
    "Worlds 0 and 1 of 2 are one and the same Slope: let what makes them build a new one at each "
    "call, or train in one, with seeds and num_envs 1."
)
WORLD = Slope()
gymnasium.register("OneSlope-v0", lambda: WORLD, max_episode_steps=9)


class Single(Slope):
    """There is one of it, however often it is built."""

    only = None

    def __new__(cls):
        cls.only = cls.only or super().__new__(cls)
        return cls.only


class ByHand(gymnasium.Env):
    """A wrapper that Gymnasium does not know for one."""

    observation_space, action_space = Slope.observation_space, Slope.action_space

    def __init__(self):
        self.inside = [WORLD]


def vector(*worlds):
    return SyncVectorEnv([functools.partial(lambda world: world, world) for world in worlds])


def refused(make, **changes):
    given = {"environment": make} if isinstance(make, str) else {"environment": "Slope"}
    config = Config("copdac-q", **given, log_every=10, **changes)
    with pytest.raises(ValueError, match=r"\.$") as said:
        engine_of(config, None if isinstance(make, str) else make)
    return str(said.value)


@pytest.mark.parametrize(
    "make",
    [
        lambda: WORLD,
        lambda: wrappers.ClipAction(WORLD),
        lambda: wrappers.TimeLimit(wrappers.RecordEpisodeStatistics(WORLD), 5),
        WORLD,
        "OneSlope-v0",
        lambda: vector(WORLD),
    ],
)
def test_one_object_that_trains_and_is_judged_is_refused(make):
    assert refused(make) == ONE_OBJECT


def test_so_is_one_that_is_built_in_disguise():
    assert refused(Single) == ONE_OBJECT.replace("same Slope", "same Single")
    assert refused(ByHand) == ONE_OBJECT
    both = vector(Slope(), Slope())
    assert refused(lambda: both, num_envs=2) == ONE_OBJECT


@pytest.mark.parametrize("changes", [{"seeds": 2}, {"num_envs": 2}, {"num_envs": 2, **SAME}])
@pytest.mark.parametrize("make", [lambda: WORLD, "OneSlope-v0", lambda: vector(WORLD, WORLD)])
def test_copies_that_are_one_object_are_refused(make, changes):
    assert refused(make, **changes) == TWICE


def test_it_is_refused_from_everywhere(tmp_path):
    with pytest.raises(ValueError, match=f"^{re.escape(ONE_OBJECT)}$"):
        Trainer("opdac", lambda: WORLD, **SMALL)
    config = Config("opdac", "OneSlope-v0", **SMALL, steps=10, checkpoint_every=10)
    with pytest.raises(ValueError, match=f"^{re.escape(ONE_OBJECT)}$"):
        train_in(tmp_path / "run", config)
    assert not (tmp_path / "run").exists()


class Closing(Slope):
    closed = False

    def close(self):
        self.closed = True


def rig():
    """What builds worlds of which only one can be open, and those that it built."""
    made = []

    def make():
        if any(not world.closed for world in made):
            raise OSError("the port is busy")
        made.append(Closing())
        return made[-1]

    return make, made


def test_a_world_of_which_one_can_be_open():
    make, made = rig()
    assert refused(make) == (
        "No second world can be opened for evaluations beside the one that trains (environment "
        "'make' cannot be built: OSError: the port is busy): judge in the one that trains, "
        "--judge-in-same-world (in Python judge_in_same_world=True), or not at all, "
        "--evaluation-episodes 0."
    )
    assert [world.closed for world in made] == [True]
    assert refused(make, seeds=3, **SAME) == (
        "3 worlds cannot be open at once (environment 'make' cannot be built: OSError: the port is "
        "busy): take fewer, with seeds and num_envs 1 a single one."
    )
    assert [world.closed for world in made] == [True, True]


@pytest.fixture(scope="module")
def apart():
    """An engine that judges in worlds of its own, and one that does not."""
    learner = ALGORITHMS["copdac-q"].create(SPEC, sigma=0.8, correlation=0.7, alpha_theta=0.01)
    made, config = [], Config("copdac-q", "Slope", seed=5, log_every=10, num_envs=2)

    def make():
        made.append(Slope())
        return made[-1]

    engines = [engine_of(config, Slope), engine_of(replaced(config, **SAME), make)]
    for engine in engines:
        engine.use(learner)
    return *engines, made


def replaced(config, **changes):
    return Config.from_json(config.as_json() | changes)


def same(one, other):
    jax.tree.map(np.testing.assert_array_equal, one, other)


def test_judged_in_the_same_world_training_goes_on_in_new_episodes(apart):
    usual, one, made = apart
    assert len(made) == 2
    half = usual.advance(usual.begin(), 10)
    state = one.advance(one.begin(), 10)
    same(state, half)
    before = [len(world.starts) for world in made]
    found = one.play(one.learners(state), episodes=3, seed=5)
    same(list(found), list(usual.play(usual.learners(half), episodes=3, seed=5)))
    assert [len(world.starts) - k for world, k in zip(made, before)] == [4, 0]
    # What a run that was stopped here goes on with: traces and noise anew, and so the episodes.
    resumed = usual.resume(half, 10)
    same(one.advance(state, 10), usual.advance(resumed, 10))
    assert np.any(half.observation != resumed.observation)


def test_a_rig_is_trained_and_judged_or_not_judged(tmp_path):
    make, made = rig()
    told = []
    small = {**SMALL, "steps": 20, "checkpoint_every": 10}
    config = Config("opdac", "rig", **small, **SAME, evaluation_episodes=2)
    report = {"report": lambda progress: told.extend(progress.messages)}
    train_in(tmp_path / "same", config, world=make, **report)
    assert told[1] == (
        "Evaluations are played in the world that trains: each cuts the episode under way, and "
        "training goes on with a new one."
    )
    run = open_run(tmp_path / "same", world=make)
    assert run.play("best", episodes=3)["length"].to_pylist() == [3, 4, 3]
    assert all(world.closed for world in made)

    told.clear()
    config = Config("opdac", "rig", **small, evaluation_episodes=0)
    train_in(tmp_path / "none", config, world=make, **report)
    assert told[1:] == ["Nothing is evaluated: the last policy counts as the best."]
    run = open_run(tmp_path / "none", world=make)
    same(run.learners("best"), run.learners("last"))
    assert run.index() == 0
    assert run.play("best", episodes=1)["length"].to_pylist() == [3]
    with pytest.raises(ValueError, match=r"has no evaluations and no return: plot what training"):
        read(tmp_path / "none", "return")
    assert read(tmp_path / "none", "rollout/ep_len_mean").values.shape == (2, 1)
    assert len(made) == 4


def test_a_world_that_was_given_is_left_open():
    world = Closing()
    trainer = Trainer("opdac", world, **SMALL, evaluation_episodes=0)
    assert trainer.evaluate(2)[0] < 0
    trainer.session.engine.close()
    assert not world.closed


def test_learners_of_a_vector_environment_are_judged_each_in_its_copies():
    learner = ALGORITHMS["copdac-q"].create(SPEC)
    config = Config("copdac-q", "Slope", seeds=2, num_envs=2)
    engine = engine_of(config, lambda: SyncVectorEnv([Slope] * 4))
    engine.use(learner)
    learners = engine.learners(engine.begin())
    other = eqx.tree_at(lambda tree: tree.theta, learners, learners.theta.at[1].add(0.3))
    found = engine.play(other, episodes=3, seed=8)
    plain = engine_of(Config("copdac-q", "Slope", seeds=2), Slope)
    plain.use(learner)
    expected = plain.play(other, episodes=1, seed=8)
    assert found.lengths.tolist() == [[3, 4, 3]] * 2
    np.testing.assert_allclose(found.returns[:, 0], expected.returns[:, 0], rtol=1e-5)
    assert found.returns[0, 0] != found.returns[1, 0]


def fixed():
    world = wrappers.NormalizeObservation(Slope())
    world.update_running_mean = False
    return world


@pytest.mark.parametrize(
    ("make", "changes", "found", "kind"),
    [
        (lambda: wrappers.NormalizeObservation(Slope()), {}, "obs_rms", "observations"),
        (lambda: wrappers.TimeLimit(wrappers.NormalizeReward(Slope()), 4), SAME, "return_rms", ""),
        (
            lambda: wrappers.vector.NormalizeObservation(SyncVectorEnv([Slope] * 2)),
            {"num_envs": 2},
            "obs_rms",
            "observations",
        ),
        (
            lambda: SyncVectorEnv([lambda: wrappers.NormalizeReward(Slope())] * 2),
            {"seeds": 2},
            "return_rms",
            "",
        ),
    ],
)
def test_running_statistics_in_a_world_are_refused(make, changes, found, kind):
    kind = kind or "rewards"
    layer = "NormalizeReward" if kind == "rewards" else "NormalizeObservation"
    assert refused(make, **changes) == (
        f"The world's {layer} keeps running statistics ({found}), so that training, evaluations "
        "and an exported controller see different numbers: take it off and let the learner "
        f"normalise, --normalise {kind} (in Python normalise='{kind}')."
    )


def test_wrappers_without_memory_are_not():
    for make in (fixed, lambda: wrappers.RecordEpisodeStatistics(wrappers.ClipAction(Slope()))):
        engine_of(Config("copdac-q", "Slope"), make).close()
