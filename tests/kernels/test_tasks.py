"""The compiled tasks are the environments."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numba import njit

from benchmarks_data import columns
from detpg.kernels.random import streams
from detpg.kernels.tasks import TASKS, environment
from detpg.kernels.tasks.puddle_world import reward_at

KEY = jax.random.key(0)
ROUNDING = {"rtol": 1e-13, "atol": 1e-13}


def compiled(task):
    start, move = TASKS[task].start, TASKS[task].move

    @njit
    def steps(constants, stream, states, actions, rewards, ends):
        for t in range(len(states)):
            rewards[t], ends[t] = move(constants, stream, states[t], actions[t])

    @njit
    def starts(constants, stream, states):
        for t in range(len(states)):
            start(constants, stream, states[t])

    return steps, starts


def stream():
    return streams(0, [0], [0])[0, 0, 0]


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("task", TASKS)
def test_every_step_is_that_of_the_environment(task):
    world = environment(task, {"noise": 0.0} if task == "puddle-world" else {})
    spec, generator = world.spec, np.random.default_rng(1)
    low, high = np.array(spec.observation_low), np.array(spec.observation_high)
    states = generator.uniform(low, high, (2000, 2))
    states[:300] = np.clip(states[:300] * 1.3, low, high)  # at the edges, too
    actions = generator.uniform(-2, 2, (2000, spec.action_size)) * np.array(spec.action_high)
    expected = jax.vmap(world.transition, in_axes=(None, 0, 0))(KEY, states, actions)
    found, rewards, ends = states.copy(), np.zeros(2000), np.zeros(2000, bool)
    compiled(task)[0](TASKS[task].constants(world), stream(), found, actions, rewards, ends)
    np.testing.assert_allclose(found, expected, **ROUNDING)
    expected_rewards = jax.vmap(world.reward)(states, actions, expected)
    np.testing.assert_allclose(rewards, expected_rewards, **ROUNDING)
    np.testing.assert_array_equal(ends, jax.vmap(world.terminated)(expected))
    assert ends.any() == (task != "pendulum")


def test_the_reward_of_the_puddle_world_on_a_grid():
    """Bumps that are too far away to be noticed are left out."""
    table = columns("env_puddle_reward_grid")
    constants = TASKS["puddle-world"].constants(environment("puddle-world", {}))
    states = np.stack([table["x"], table["y"]], axis=1)
    found = [reward_at(constants, state) for state in states]
    np.testing.assert_allclose(found, table["reward"], rtol=1e-13)


@pytest.mark.parametrize("size", [0.0025, 0.025])
def test_the_noise_of_the_puddle_world(size):
    world = environment("puddle-world", {"noise": size})
    states, actions = np.full((4000, 2), 0.5), np.zeros((4000, 2))
    steps, _ = compiled("puddle-world")
    steps(
        TASKS["puddle-world"].constants(world),
        stream(),
        states,
        actions,
        np.zeros(4000),
        np.zeros(4000, bool),
    )
    drawn = states - 0.5
    assert np.max(np.abs(drawn)) <= size
    # mean 0 and variance size^2 / 3 (its own variance 4 size^4 / 45), at 4.5 standard errors
    assert abs(drawn.mean()) < 4.5 * size / np.sqrt(3 * 8000)
    assert abs(np.mean(drawn**2) - size**2 / 3) < 4.5 * size**2 * np.sqrt(4 / 45 / 8000)


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("task", TASKS)
def test_the_start(task):
    world, states = environment(task, {}), np.zeros((1, 2))
    compiled(task)[1](TASKS[task].constants(world), stream(), states)
    np.testing.assert_array_equal(states[0], world.initial(KEY))


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("task", ["mountain-car", "pendulum"])
def test_a_random_start_has_the_distribution_of_the_environments(task):
    world, states = environment(task, {"random_start": True}), np.zeros((2000, 2))
    compiled(task)[1](TASKS[task].constants(world), stream(), states)
    drawn = jax.vmap(world.initial)(jax.random.split(KEY, 2000))
    low, high = (np.array(b) for b in (world.spec.observation_low, world.spec.observation_high))
    found, expected = (2 * (np.asarray(x) - low) / (high - low) - 1 for x in (states, drawn))
    # both uniform on [-1, 1], or both constant; standard errors of mean and mean square
    for moment, deviation in ((1, np.sqrt(1 / 3)), (2, np.sqrt(4 / 45))):
        gap = np.mean(found**moment, axis=0) - np.mean(expected**moment, axis=0)
        assert np.all(np.abs(gap) < 4.5 * deviation * np.sqrt(2 / 2000))


def test_numbers_are_exact_without_double_precision_in_force():
    assert jnp.asarray(0.6).dtype == jnp.float32
    constants = TASKS["mountain-car"].constants(environment("mountain-car", {}))
    assert constants.tolist() == [0.001, 0.0025, 3.0, 0.6, -0.5, 0.0]


def test_an_unknown_task_is_refused():
    with pytest.raises(ValueError, match=r"^Task 'lqr' is not compiled: choose one of mount.*\.$"):
        environment("lqr", {})
