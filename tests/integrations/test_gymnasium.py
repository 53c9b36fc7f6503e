"""Our environments under Gymnasium's interface: its own checks, and what they cannot know."""

import subprocess
import sys
import tomllib
import warnings
from importlib.metadata import EntryPoint
from pathlib import Path

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from detpg.environments import ENVIRONMENTS, LQR, MountainCar, OctopusArm, ScaledActions
from detpg.figures.frames import FRAMES
from detpg.integrations import registration
from detpg.integrations.gymnasium import GymnasiumEnv, GymnasiumVectorEnv, single, vector
from detpg.integrations.gymnasium.parts import PICTURED

ARM = {"num_segments": 2, "time_limit": 4, "start_noise": 0.1}
# Two programs differ in the last bit, and the arm at rest takes the square root of that.
NEAR = {"rtol": 1e-7, "atol": 1e-7}
# What check_env says of boxes that are as the paper has them: recommendations, no errors.
TASTE = ("we recommend using a symmetric and normalized space", "probably too")
IDEAL = ("detpg/MountainCar-v0", "detpg/PuddleWorld-v0")


def ids():
    return [f"detpg/{environment.__name__}-v0" for environment in ENVIRONMENTS.values()]


def made(name, **options):
    arm = {"num_segments": 2} if name == "detpg/OctopusArm-v0" else {}
    return gymnasium.make(name, **arm, **options)


class Wall:
    """In the place of a window."""

    def __init__(self):
        self.pictures, self.closed = [], 0

    def show(self, picture, seconds):
        self.pictures.append(picture)

    def close(self):
        self.closed += 1


@pytest.fixture
def wall(monkeypatch):
    there = Wall()
    monkeypatch.setattr(single, "_open_window", lambda environment: there)
    return there


@pytest.mark.parametrize("name", ids())
def test_gymnasium_accepts_it(name, wall):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        check_env(made(name).unwrapped)
    messages = [str(warning.message) for warning in said]
    assert all(any(words in message for words in TASTE) for message in messages)
    assert not (messages and name in IDEAL)


@pytest.mark.parametrize("name", ids())
def test_observations_stay_inside_their_space(name):
    world = made(name)
    assert world.observation_space.dtype == np.float32
    world.reset(seed=0)
    world.action_space.seed(0)
    for _ in range(50):
        observation, _, terminated, truncated, _ = world.step(world.action_space.sample())
        assert observation in world.observation_space
        if terminated or truncated:
            world.reset()


def episode(world, seed, steps=5):
    seen = [world.reset(seed=seed)[0]]
    for _ in range(steps):
        seen.append(world.step(np.ones(world.action_space.shape, np.float32))[0])
    return np.stack(seen)


def test_a_seed_fixes_every_episode():
    world, other = gymnasium.make("detpg/LQR-v0"), gymnasium.make("detpg/LQR-v0")
    first = episode(world, 3), episode(world, None)
    again = episode(other, 3), episode(other, None)
    np.testing.assert_array_equal(first, again)
    assert np.all(first[0] != first[1])  # the noise of each step too
    assert np.all(first[0] != episode(world, 4))


def test_steps_are_those_of_the_environment(x64):
    arm = OctopusArm(2, start_noise=0.1)
    world = GymnasiumEnv(arm)
    first, _ = world.reset(seed=0)
    state, action = world.episode.state, jnp.linspace(0.0, 1.0, 8)
    observation, reward, *_ = world.step(np.asarray(action))

    @jax.jit
    def expected():
        next_state = arm.transition(jax.random.key(0), state, action)  # draws nothing
        return arm.observe(state), arm.observe(next_state), arm.reward(state, action, next_state)

    for ours, theirs in zip((first, observation, reward), expected()):
        np.testing.assert_allclose(ours, theirs, **NEAR)


def test_actions_are_capped_by_the_world():
    low, high = (gymnasium.make("detpg/Pendulum-v0") for _ in range(2))
    for world in (low, high):
        world.reset()
    np.testing.assert_array_equal(low.step([2])[0], high.step([np.inf])[0])


def test_a_time_limit_truncates_and_an_end_terminates():
    arm = GymnasiumEnv("octopus-arm", **ARM)
    arm.reset(seed=0)
    assert [arm.step(np.zeros(8))[2:4] for _ in range(4)] == [(False, False)] * 3 + [(False, True)]
    car = GymnasiumEnv("mountain-car", start=0.59)
    car.reset()
    ends = [car.step([1.0])[2:4] for _ in range(5)]
    assert (True, False) in ends
    assert not any(truncated for _, truncated in ends)
    bandit = GymnasiumEnv("bandit", m=2)
    bandit.reset()
    assert bandit.step([0.0, 0.0])[2:4] == (True, False)


def test_what_cannot_be_used_is_refused():
    world = gymnasium.make("detpg/Pendulum-v0")
    with pytest.raises(ResetNeeded):
        world.step([0.0])
    with pytest.raises(ResetNeeded, match=r"^There is no episode yet: call reset\(\) first\.$"):
        world.unwrapped.step([0.0])
    world.reset()
    with pytest.raises(ValueError, match=r"^The action has 1 NaN, the first at \[0\]: give .*\.$"):
        world.step([np.nan])
    with pytest.raises(ValueError, match=r"^The action has shape \(2,\): give one of .*\(1,\)\.$"):
        world.step([0.0, 0.0])
    with pytest.raises(ValueError, match=r"^environment 'squid' is unknown: choose one of .*\.$"):
        GymnasiumEnv("squid")
    with pytest.raises(ValueError, match=r"^The environment is built already and takes no m: .*$"):
        GymnasiumEnv(LQR(), m=3)
    with pytest.raises(ValueError, match=r"^render_mode 'rgb_array' is unknown: .* no picture\.$"):
        GymnasiumEnv("lqr", render_mode="rgb_array")
    with pytest.raises(ValueError, match=r"^render_mode 'ansi' is unknown: choose one of human, "):
        GymnasiumEnv("pendulum", render_mode="ansi")


def test_the_tip_of_the_arm_leaves_a_trace_of_its_episode():
    world = GymnasiumEnv(OctopusArm(2), render_mode="rgb_array")
    world.reset(seed=0)
    for _ in range(20):
        world.step(np.eye(8)[0])
    traced = world.render()
    moved = np.asarray(world._path)
    assert moved.shape == (21, 2)
    assert np.ptp(moved, axis=0).max() > 0.01
    world._path = []
    assert (traced != world.render()).any()
    world.reset(seed=0)
    assert len(world._path) == 1


def test_pictures(wall):
    assert set(PICTURED) == set(FRAMES)
    world = GymnasiumEnv(ScaledActions(OctopusArm(2)), render_mode="rgb_array")
    world.reset()
    pictures = [world.render()]
    world.step(np.ones(8))
    pictures.append(world.render())
    assert [picture.shape for picture in pictures] == [(480, 480, 3)] * 2
    assert np.any(pictures[0] != pictures[1])
    assert GymnasiumEnv("pendulum").render() is None
    shown = GymnasiumEnv("pendulum", render_mode="human")
    shown.reset()
    shown.step([1.0])
    shown.close()
    assert shown.render() is None
    assert [picture.shape for picture in wall.pictures] == [(480, 480, 3)] * 2
    assert wall.closed == 1


WORLDS = {
    "noise": ("lqr", {}, 1.0),
    "ends": ("mountain-car", {"random_start": True, "goal": -0.4}, 1.0),
    "limits": ("octopus-arm", ARM, 0.5),
}


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("case", WORLDS)
def test_a_batch_is_its_single_worlds(case, mode, x64):
    name, options, size = WORLDS[case]
    batch = GymnasiumVectorEnv(name, 4, autoreset_mode=mode, **options)
    copies = [lambda: GymnasiumEnv(name, **options)] * 4
    singles = SyncVectorEnv(copies, autoreset_mode=AutoresetMode(mode))
    assert batch.observation_space == singles.observation_space
    assert batch.action_space == singles.action_space
    np.testing.assert_allclose(batch.reset(seed=7)[0], singles.reset(seed=7)[0], **NEAR)
    actions = size * np.random.default_rng(0).uniform(0, 1, (30, *batch.action_space.shape))
    over = 0
    for action in actions:
        ours, theirs = batch.step(action), singles.step(action)
        np.testing.assert_allclose(ours[0], theirs[0], **NEAR)
        np.testing.assert_allclose(ours[1], theirs[1], **NEAR)
        np.testing.assert_array_equal(ours[2:4], theirs[2:4])
        assert ours[1].dtype == theirs[1].dtype
        assert set(ours[4]) == set(theirs[4])
        for mask in ("_final_obs", "_final_info"):
            np.testing.assert_array_equal(ours[4].get(mask), theirs[4].get(mask))
        for last, other in zip(ours[4].get("final_obs", ()), theirs[4].get("final_obs", ())):
            np.testing.assert_equal(last is None, other is None)
            if last is not None:
                np.testing.assert_allclose(last, other, **NEAR)
        over += np.sum(ours[2] | ours[3])
    assert (over > 4) == (case != "noise")  # else the resets were not compared


def test_a_batch_steps_from_the_same_states(x64):
    batch = GymnasiumVectorEnv("octopus-arm", 3, num_segments=2, start_noise=0.1)
    batch.reset(seed=0)
    world = GymnasiumEnv("octopus-arm", num_segments=2, start_noise=0.1)
    for action in np.random.default_rng(0).uniform(0, 1, (10, 3, 8)):
        before = batch.episodes
        observations, rewards, *_ = batch.step(action)
        for i in range(3):
            world.episode = jax.tree.map(lambda leaf, at=i: leaf[at], before)
            observation, reward, *_ = world.step(action[i])
            np.testing.assert_allclose(observations[i], observation, **NEAR)
            assert rewards[i] == pytest.approx(reward, abs=1e-7)


def test_a_batch_is_compiled_once():
    worlds = gymnasium.make_vec("detpg/LQR-v0", num_envs=5)
    assert isinstance(worlds, GymnasiumVectorEnv)
    assert worlds.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    worlds.reset(seed=0)
    before = vector._advance_all._cache_size()
    for _ in range(250):  # past the time limit, so with resets
        worlds.step(np.zeros((5, 1), np.float32))
    assert vector._advance_all._cache_size() == before + 1


def test_resets_by_hand():
    worlds = GymnasiumVectorEnv(MountainCar(start=0.59), 3, autoreset_mode="Disabled")
    worlds.reset(seed=[1, None, 2])
    while not np.any(worlds.step([[1.0], [-1.0], [1.0]])[2]):
        pass
    with pytest.raises(ResetNeeded, match=r"^The episodes of the copies 0, 2 are over: reset .*$"):
        worlds.step(np.zeros((3, 1)))
    before = worlds.episodes
    observations, _ = worlds.reset(options={"reset_mask": np.array([True, False, True])})
    np.testing.assert_allclose(observations[[0, 2], 0], 0.59, rtol=1e-6)
    np.testing.assert_array_equal(worlds.episodes.state[1], before.state[1])
    np.testing.assert_array_equal(worlds.episodes.steps, [0, before.steps[1], 0])
    worlds.step(np.zeros((3, 1)))


def test_batches_that_cannot_be_used_are_refused():
    with pytest.raises(ValueError, match=r"^num_envs = 0 is not usable: give 1 or more\.$"):
        GymnasiumVectorEnv("lqr", 0)
    worlds = GymnasiumVectorEnv("lqr", 2)
    with pytest.raises(ResetNeeded):
        worlds.step(np.zeros((2, 1)))
    with pytest.raises(ValueError, match=r"^3 seeds do not fit 2 copies\.$"):
        worlds.reset(seed=[1, 2, 3])
    with pytest.raises(ValueError, match=r"^reset_mask is not usable: give 2 booleans, .*\.$"):
        worlds.reset(options={"reset_mask": np.array([False, False])})
    worlds.reset()
    with pytest.raises(ValueError, match=r"the first at \[1, 0\]: give finite numbers\.$"):
        worlds.step([[0.0], [np.nan]])


def test_pictures_of_a_batch():
    worlds = gymnasium.make_vec("detpg/Pendulum-v0", num_envs=2, render_mode="rgb_array")
    worlds.reset(seed=0)
    worlds.step([[2.0], [-2.0]])
    pictures = worlds.render()
    assert [picture.shape for picture in pictures] == [(480, 480, 3)] * 2
    assert np.any(pictures[0] != pictures[1])


def test_only_what_is_used_is_imported():
    """Whichever of the two is imported first, its ids are known, and JAX is not needed for that."""
    code = """
import importlib.util, sys, detpg
assert not {"jax", "gymnasium", "numpy"} & set(sys.modules)
assert importlib.util.find_spec("gymnasium") is not None  # looking for it is not importing it
import gymnasium, warnings
warnings.simplefilter("error")
ids = sorted(id for id in gymnasium.registry if id.startswith("detpg/"))
print(*ids)
for id in ids:
    del gymnasium.registry[id]
assert "jax" not in sys.modules
del sys.modules["detpg"]
gymnasium.make("detpg:detpg/Pendulum-v0").reset()
assert ids == sorted(id for id in gymnasium.registry if id.startswith("detpg/"))
gymnasium.make_vec("detpg/LQR-v0", num_envs=2).close()
sys.exit("matplotlib" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == sorted(ids())


def test_registering_again_changes_nothing():
    """A warning would be an error here."""
    kinds = {name: environment.__name__ for name, environment in ENVIRONMENTS.items()}
    assert kinds == registration.CLASSES
    before = dict(gymnasium.registry)
    registration.register()
    assert gymnasium.registry == before


def test_the_entry_point_of_older_versions_is_declared():
    """Under the key, which they put before each name."""
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    declared = EntryPoint("detpg", project["entry-points"]["gymnasium.envs"]["detpg"], "")
    assert declared.load() is registration.register
