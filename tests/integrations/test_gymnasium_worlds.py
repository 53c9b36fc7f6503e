"""Gymnasium environments as worlds: against loops written by hand, in every way of resetting."""

import gymnasium
import numpy as np
import pytest
from counting import ENDS, Counting, Spaced, opened
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeLimit

from detpg.environments import OctopusArm
from detpg.integrations.gymnasium.hosted import DISCOUNT
from detpg.integrations.gymnasium.worlds import NO_TIME_LIMIT, Worlds, open_worlds
from detpg.world_error import WorldError

ONE = Box(-1.0, 1.0, (1,))
MODES = [None, *AutoresetMode]


def transitions(worlds, seeds, steps, action=0.5):
    """Of each world, what there is to learn from: (s, r, s', terminated, truncated)."""
    found = [[] for _ in seeds]
    observation = worlds.reset(seeds)
    for _ in range(steps):
        step = worlds.step(np.full((worlds.num, worlds.spec.action_size), action, np.float32))
        for i in np.flatnonzero(step.valid):
            ends = bool(step.terminated[i]), bool(step.truncated[i])
            before, after = observation[i].tolist(), step.next_observation[i].tolist()
            found[i].append((before, float(step.reward[i]), after, *ends))
        observation = step.observation
    return found


def by_hand(seed, steps, action=0.5):
    """What `transitions` finds in one world, from the definition of `Counting`."""
    found, episode, at = [], 0, 0
    for _ in range(steps):
        length, terminated, truncated = ENDS[(episode + seed) % len(ENDS)]
        over = at + 1 == length
        reward = 10.0 * episode + at + 1 + action
        ends = terminated and over, truncated and over
        found.append(([seed, episode, at], reward, [seed, episode, at + 1], *ends))
        episode, at = (episode + 1, 0) if over else (episode, at + 1)
    return found


@pytest.mark.parametrize("mode", MODES)
def test_every_way_of_resetting_gives_the_same_transitions(mode):
    worlds = opened(mode, 2)
    assert isinstance(worlds, Worlds)
    calls = 36
    for found, seed in zip(transitions(worlds, [7, 9], calls), (7, 9)):
        # Three episodes are nine steps; with the resets in calls of their own, twelve calls.
        assert len(found) == (27 if mode == AutoresetMode.NEXT_STEP else calls)
        assert found == by_hand(seed, len(found))


@pytest.mark.parametrize("num", [1, 3])
def test_pendulum_is_what_a_loop_by_hand_gives(num):
    worlds = open_worlds("Pendulum-v1", num)
    envs = [gymnasium.make("Pendulum-v1") for _ in range(num)]
    seeds = list(range(5, 5 + num))
    observation = worlds.reset(seeds)
    np.testing.assert_array_equal(observation, [e.reset(seed=s)[0] for e, s in zip(envs, seeds)])
    actions = np.random.default_rng(0).uniform(-2, 2, (450, num, 1)).astype(np.float32)
    cut = 0
    for action in actions:
        step = worlds.step(action)
        hand = [env.step(a) for env, a in zip(envs, action)]
        expected = [np.stack(column) for column in list(zip(*hand))[:4]]
        np.testing.assert_array_equal(step.next_observation, expected[0])
        np.testing.assert_array_equal(step.reward, expected[1].astype(np.float32))
        np.testing.assert_array_equal(step.terminated, expected[2])
        np.testing.assert_array_equal(step.truncated, expected[3])
        assert step.valid.all()
        starts = [e.reset()[0] if h[3] else h[0] for e, h in zip(envs, hand)]
        np.testing.assert_array_equal(step.observation, starts)
        cut += step.truncated.sum()
    assert cut == 2 * num
    kinds = [np.float32, np.float32, bool, bool, np.float32, bool]
    assert [field.dtype for field in step] == kinds
    assert [field.shape for field in step] == [(num,), (num, 3), (num,), (num,), (num, 3), (num,)]


@pytest.mark.parametrize("mode", MODES)
def test_the_next_observation_is_the_one_before_the_reset(mode):
    worlds = opened(mode, 1)
    worlds.reset([6])
    for _ in range(3):
        step = worlds.step([[0.0]])
    assert step.terminated.all()
    np.testing.assert_array_equal(step.next_observation, [[6, 0, 3]])
    if mode == AutoresetMode.NEXT_STEP:
        step = worlds.step([[0.0]])
        assert not np.any([step.valid, step.terminated, step.truncated, step.reward])
    np.testing.assert_array_equal(step.observation, [[6, 1, 0]])


def test_what_is_handed_on_stays():
    class Reusing(Counting):
        """Writes into the array that it handed on before."""

        memory = np.zeros(3, np.float32)

        def seen(self):
            self.memory[...] = super().seen()
            return self.memory

    # In SAME_STEP Gymnasium itself resets before it hands the last observation on.
    for mode in (None, AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED):
        worlds = opened(mode, 1, Reusing)
        first = worlds.reset([3])
        steps = [worlds.step([[0.0]]) for _ in range(4)]
        assert first.tolist() == [[3, 0, 0]]
        assert [s.next_observation[0, 2] for s in steps[:3]] == [1, 2, 3]


def test_only_the_copies_that_began_anew_are_looked_at():
    class Forgetful(SyncVectorEnv):
        """After a reset of some copies, says nothing of the others."""

        def reset(self, *, seed=None, options=None):
            mask = (options or {}).get("reset_mask", np.ones(self.num_envs, bool)).copy()
            seen, info = super().reset(seed=seed, options=options)
            return np.where(mask[:, None], seen, np.nan), info

    worlds = open_worlds(Forgetful([Counting] * 2, autoreset_mode=AutoresetMode.DISABLED))
    for found, seed in zip(transitions(worlds, [7, 9], 20), (7, 9)):
        assert found == by_hand(seed, 20)


def noisy_run(worlds, seeds):
    seen = [worlds.reset(seeds)]
    for _ in range(250):
        low, high = (np.asarray(bound, np.float32) for bound in worlds.spec.bounds)
        actions = [worlds.envs[i].action_space.sample() for i in range(worlds.num)]
        seen.append(worlds.step(np.clip(np.stack(actions), low, high)).observation)
    return np.stack(seen)


def test_a_run_follows_from_its_seeds():
    one, other = open_worlds("Pendulum-v1", 2), open_worlds("Pendulum-v1", 2)
    run = noisy_run(one, [3, 4])
    np.testing.assert_array_equal(run, noisy_run(other, np.array([3, 4])))
    np.testing.assert_array_equal(run, noisy_run(one, [3, 4]))
    assert np.all(run[200] != run[0])  # the second episode starts elsewhere
    assert np.all(run != noisy_run(one, [5, 6]))
    with pytest.raises(ValueError, match=r"^3 seeds do not fit 2 worlds: give one for each\.$"):
        one.reset([1, 2, 3])


@pytest.mark.parametrize("mode", MODES)
def test_seeds_are_those_of_the_worlds_one_by_one(mode):
    worlds = opened(mode, 2, lambda: gymnasium.make("Pendulum-v1"))
    expected = [gymnasium.make("Pendulum-v1").reset(seed=seed)[0] for seed in (11, 5)]
    np.testing.assert_array_equal(worlds.reset([11, 5]), expected)


def test_time_limits():
    def limit(*given, **options):
        worlds = open_worlds(*given, **options)
        known = NO_TIME_LIMIT if worlds.time_limit is None else worlds.time_limit
        assert worlds.spec.time_limit == known
        return worlds.time_limit

    assert limit("Pendulum-v1") == 200
    assert limit("Pendulum-v1", time_limit=1000) == 1000
    assert limit(Counting) is None
    assert limit(Counting, time_limit=7) == 7
    assert limit(TimeLimit(TimeLimit(Counting(), 9), 11), time_limit=10) == 9
    assert limit("detpg/OctopusArm-v0", options={"num_segments": 2}) == OctopusArm().spec.time_limit
    assert limit("detpg/OctopusArm-v0", options={"num_segments": 2}, time_limit=3) == 3
    assert limit(gymnasium.make_vec("Pendulum-v1", 2)) == 200
    assert limit(gymnasium.make_vec("Pendulum-v1", 2, max_episode_steps=8), time_limit=8) == 8
    assert limit(gymnasium.make_vec("detpg/LQR-v0", 2)) == 200
    assert limit(SyncVectorEnv([Counting])) is None
    worlds = open_worlds(Counting, time_limit=2)
    worlds.reset([0])
    ends = [worlds.step([[0.0]]) for _ in range(4)]
    assert [bool(end.truncated[0]) for end in ends] == [False, True, False, True]
    assert not any(end.terminated.any() for end in ends)


def test_a_limit_where_the_world_ends_too_is_both():
    worlds = open_worlds(Counting, time_limit=3)
    worlds.reset([0])
    step = [worlds.step([[0.0]]) for _ in range(3)][-1]
    assert step.terminated.all()
    assert step.truncated.all()


def test_the_spec_says_what_is_known():
    spec = open_worlds("MountainCarContinuous-v0").spec
    assert (spec.name, spec.observation_size, spec.action_size) == (
        "MountainCarContinuous-v0",
        2,
        1,
    )
    assert (spec.bounds, spec.time_limit, spec.discount) == (((-1.0,), (1.0,)), 999, DISCOUNT)
    np.testing.assert_allclose(spec.observation_low, [-1.2, -0.07], rtol=1e-6)
    np.testing.assert_allclose(spec.observation_high, [0.6, 0.07], rtol=1e-6)
    assert open_worlds(Counting).spec.name == "Counting"
    assert open_worlds(gymnasium.make_vec("Pendulum-v1", 3)).spec.name == "Pendulum-v1"
    arm = open_worlds("detpg/OctopusArm-v0", options={"num_segments": 2})
    assert arm.spec.discount == OctopusArm().spec.discount


class Old:
    """An environment as gym had it before 0.26."""

    def reset(self):
        return np.zeros(3)

    def step(self, action):
        return np.zeros(3), 0.0, False, {}


gymnasium.register("Old-v0", Old)


@pytest.mark.parametrize(
    ("given", "options", "words"),
    [
        (
            "Pendulm-v1",
            {},
            r"^environment 'Pendulm-v1' cannot be built: .*Did you mean.*Pendulum.*$",
        ),
        ("Pendulum-v9", {}, r"^environment 'Pendulum-v9' cannot be built: .*v9.*$"),
        ("no_such_module:X-v0", {}, r"cannot be built: No module named 'no_such_module'\. "),
        (
            "LunarLanderContinuous-v3",
            {},
            r"^environment 'LunarLanderContinuous-v3' cannot be built",
        ),
        ("Pendulum-v1", {"options": {"mass": 1}}, r"^environment 'Pendulum-v1' .*'mass'"),
        (dict, {}, r"^dict made a builtins\.dict, which is no gymnasium\.Env: give one, its id or"),
        (Old, {}, r"^Old made a .*\.Old, which is no gymnasium\.Env: derive its class .* shimmy\."),
        (
            Old(),
            {},
            r"^Old is no gymnasium\.Env: derive its class from that; one of the old gym can",
        ),
        (
            "Old-v0",
            {},
            r"^environment 'Old-v0' is no gymnasium\.Env: derive its class from that; o",
        ),
        (Counting, {"num": 0}, r"^num = 0 is not usable: give 1 or more\.$"),
        (Counting, {"time_limit": 0}, r"^time_limit = 0 is not usable"),
        (Counting(), {"num": 2}, r"^One environment cannot be 2 worlds: give its id, its class or"),
        (Counting(), {"options": {"a": 1}}, r"^The environment is built already and takes no a: "),
        (Counting(), {"render_mode": "rgb_array"}, r"built already, with render_mode None and not"),
        (SyncVectorEnv([Counting] * 2), {"num": 3}, r"has 2 copies, not 3: leave num out\.$"),
        (SyncVectorEnv([Counting]), {"time_limit": 3}, r"^A time limit of 3 cannot be given to"),
    ],
)
def test_what_cannot_be_opened_is_one_sentence(given, options, words):
    with pytest.raises((ValueError, WorldError), match=words) as refused:
        open_worlds(given, **options)
    assert "\n" not in str(refused.value)


def test_worlds_of_one_kind():
    sizes = iter((1, 2))
    with pytest.raises(ValueError, match=r"^World 1 has another action space or observation size"):
        open_worlds(lambda: Spaced(Box(0.0, 1.0, (next(sizes),)), ONE), 2)


def test_pictures():
    worlds = open_worlds("detpg/Pendulum-v0", 2, render_mode="rgb_array")
    worlds.reset([0, 1])
    assert worlds.render().shape == (480, 480, 3)
    assert open_worlds("detpg/Pendulum-v0").render() is None
    batch = open_worlds(gymnasium.make_vec("detpg/Pendulum-v0", 2, render_mode="rgb_array"))
    batch.reset([0, 1])
    assert batch.render().shape == (480, 480, 3)

    class Blind(Counting):
        def render(self):
            raise gymnasium.error.DependencyNotInstalled("pygame is not installed,\nrun `pip`")

    with pytest.raises(ValueError, match=r"^Blind cannot be drawn: pygame is not installed, run `"):
        open_worlds(Blind, render_mode="rgb_array").render()


def test_worlds_are_closed():
    closed = []

    class Closing(Counting):
        def close(self):
            closed.append(self)

    open_worlds(Closing, 2).close()
    open_worlds(SyncVectorEnv([Closing] * 3)).close()
    assert len(closed) == 5
    makers = iter((Closing, dict))
    with pytest.raises(ValueError, match=r"made a builtins\.dict"):
        open_worlds(lambda: next(makers)(), 2)
    assert len(closed) == 6
