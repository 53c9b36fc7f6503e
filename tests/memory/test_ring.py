"""A memory against a plain list of what happened."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.memory import empty, num_bytes, recall, remember
from detpg.types import Transition

D, M, CAPACITY = 2, 1, 7
recalled = jax.jit(recall, static_argnums=(2, 3))
remembered = jax.jit(remember)


def transitions(t, terminated, truncated):
    """One of each world, telling its world and time in every field."""
    worlds = np.arange(len(terminated))
    told = 100.0 * worlds + t
    return Transition(
        observation=jnp.asarray(np.stack([told, -told], 1), dtype=float),
        action=jnp.asarray(told[:, None] / 1000, dtype=float),
        reward=jnp.asarray(told + 0.5, dtype=float),
        next_observation=jnp.asarray(np.stack([told + 0.25, -told], 1), dtype=float),
        next_action=jnp.zeros((len(worlds), M)),
        terminated=jnp.asarray(terminated),
        truncated=jnp.asarray(truncated),
    )


def lived(steps, worlds, seed=0, skipped=0.0):
    """A memory of random episodes, and the same as lists: (time, terminated, truncated)."""
    rng = np.random.default_rng(seed)
    memory, lists = empty(CAPACITY * worlds, D, M, worlds), [[] for _ in range(worlds)]
    for t in range(steps):
        terminated, truncated = rng.random(worlds) < 0.2, rng.random(worlds) < 0.2
        valid = rng.random(worlds) >= skipped
        memory = remembered(memory, transitions(t, terminated, truncated), jnp.asarray(valid))
        for world in np.flatnonzero(valid):
            lists[world].append((t, terminated[world], truncated[world]))
    return memory, [rows[-CAPACITY:] for rows in lists]


def expected(rows, start, n, world):
    """What a row must hold that starts at a place of a world's list, by walking on."""
    rewards, at = [], start
    while True:
        t, terminated, truncated = rows[at]
        rewards.append(100.0 * world + t + 0.5)
        if terminated or truncated or len(rewards) == n or at + 1 == len(rows):
            return rewards, 100.0 * world + t + 0.25, terminated, len(rewards)
        at += 1


@pytest.mark.parametrize("steps", [1, 5, 7, 8, 30])
@pytest.mark.parametrize(("worlds", "skipped"), [(1, 0.0), (3, 0.0), (3, 0.3)])
@pytest.mark.parametrize("n", [1, 3])
def test_rows_are_those_of_a_walk_through_a_list(steps, worlds, skipped, n):
    memory, lists = lived(steps, worlds, seed=steps, skipped=skipped)
    if not sum(map(len, lists)):
        return
    batch = jax.tree.map(np.asarray, recalled(jax.random.key(steps), memory, 64, n))
    for i in range(64):
        world, t = divmod(batch.observation[i, 0], 100)
        times = [row[0] for row in lists[int(world)]]
        assert t in times  # nothing that was forgotten, or did not count, comes back
        rewards, led_to, terminated, length = expected(
            lists[int(world)], times.index(t), n, int(world)
        )
        np.testing.assert_allclose(batch.rewards[i], [*rewards, *[0] * (n - length)])
        assert batch.next_observation[i, 0] == led_to
        assert batch.terminated[i] == terminated
        assert batch.steps[i] == length
        np.testing.assert_allclose(batch.action[i, 0], batch.observation[i, 0] / 1000, rtol=1e-6)


def test_every_transition_is_as_likely_as_every_other():
    memory, lists = lived(40, worlds=3, seed=3, skipped=0.5)
    batch = recalled(jax.random.key(1), memory, 20_000, 1)
    _, counts = np.unique(np.asarray(batch.observation[:, 0]), return_counts=True)
    rows = sum(map(len, lists))
    assert len(counts) == rows
    share = 1 / rows
    error = np.sqrt(share * (1 - share) * 20_000)
    assert np.all(np.abs(counts - 20_000 * share) < 4.5 * error)


def test_what_is_truncated_and_terminated_at_once_is_terminal():
    memory = remembered(empty(4, D, M), transitions(0, [True], [True]))
    batch = recalled(jax.random.key(0), memory, 4, 3)
    assert np.all(np.asarray(batch.terminated))
    np.testing.assert_array_equal(np.asarray(batch.steps), 1)


def test_its_bytes_are_told_before_it_is_made():
    for worlds, capacity in ((1, 10), (3, 10)):
        memory = empty(capacity, D, M, worlds)
        assert memory.rows.nbytes == num_bytes(capacity, D, M, worlds)
        assert memory.capacity * worlds >= capacity


def test_it_is_written_in_place_where_it_is_donated():
    memory = empty(1_000, D, M)
    now = transitions(0, [False], [False])
    program = jax.jit(remember, donate_argnums=0).lower(memory, now).compile()
    used = program.memory_analysis()
    assert used.alias_size_in_bytes >= memory.rows.nbytes
    assert used.temp_size_in_bytes < memory.rows.nbytes
