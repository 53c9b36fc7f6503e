"""A ring of transitions for each world: remembered in place, recalled at random, n steps a row."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from detpg.experience import Recalled
from detpg.types import Transition

SCALARS = 3  # reward, terminated, truncated: the last columns of a row


class Memory(eqx.Module):
    """The newest transitions of each world, one in a row, so that recalling one reads one place.

    A ring has a spare row: the next transition goes there whether it counts or not, and what may be
    recalled is never under the pen.

    Attributes:
        rows: s, a, s', r, terminated, truncated; raw, as the world gave them.
        added: Transitions that each world has brought so far.
        action_size: m (static).
    """

    rows: Float[Array, "worlds rows columns"]
    added: Int[Array, "worlds"]
    action_size: int = eqx.field(static=True)

    @property
    def capacity(self) -> int:
        """Transitions that each world's ring holds."""
        return self.rows.shape[1] - 1

    @property
    def sizes(self) -> Int[Array, "worlds"]:
        """Transitions that can be recalled, of each world."""
        return jnp.minimum(self.added, self.capacity)


def num_bytes(capacity: int, observation_size: int, action_size: int, worlds: int = 1) -> int:
    """What a memory takes, in single precision."""
    each = -(-capacity // worlds)
    return 4 * worlds * (each + 1) * (2 * observation_size + action_size + SCALARS)


def empty(capacity: int, observation_size: int, action_size: int, worlds: int = 1) -> Memory:
    """A memory of nothing yet.

    Args:
        capacity: Transitions that it holds, all worlds together.
        observation_size: d.
        action_size: m.
        worlds: That bring transitions side by side.
    """
    each = -(-capacity // worlds)
    rows = jnp.zeros((worlds, each + 1, 2 * observation_size + action_size + SCALARS))
    return Memory(rows, jnp.zeros(worlds, dtype=int), action_size)


def remember(
    memory: Memory, transitions: Transition, valid: Bool[Array, "worlds"] | None = None
) -> Memory:
    """With one more transition of each world; of the oldest there is one less.

    Args:
        memory: So far. Inside a compiled loop, or donated, it is written in place.
        transitions: One of each world, on a leading axis.
        valid: False where a world has only been reset: its row does not count.
    """
    worlds = memory.added.shape[0]
    scalars = (transitions.reward, transitions.terminated, transitions.truncated)
    columns = [x[:, None].astype(memory.rows.dtype) for x in scalars]
    parts = (transitions.observation, transitions.action, transitions.next_observation)
    new = jnp.concatenate([*parts, *columns], axis=1)
    places = memory.added % memory.rows.shape[1]
    if worlds == 1:
        rows = jax.lax.dynamic_update_slice(memory.rows, new[:, None], (0, places[0], 0))
    else:
        rows = memory.rows.at[jnp.arange(worlds), places].set(new, unique_indices=True)
    counted = jnp.ones(worlds, dtype=bool) if valid is None else valid
    return Memory(rows, memory.added + counted.astype(int), memory.action_size)


def cut(memory: Memory) -> Memory:
    """As if a time limit had ended each world's episode: what follows belongs to another one."""
    worlds, rows = memory.rows.shape[:2]
    newest = (memory.added - 1) % rows
    old = memory.rows[jnp.arange(worlds), newest, -1]
    flags = jnp.where(memory.added > 0, jnp.ones_like(old), old)
    marked = memory.rows.at[jnp.arange(worlds), newest, -1].set(flags)
    return Memory(marked, memory.added, memory.action_size)


def recall(key: PRNGKeyArray, memory: Memory, batch: int, n: int = 1) -> Recalled:
    """A batch drawn uniformly from all that is remembered, with replacement.

    Args:
        key: Of the draw.
        memory: Holds at least one transition.
        batch: Rows.
        n: Steps of a row. It ends earlier where the episode was terminated or truncated, and at the
            newest transition; it never runs across the place where the ring is written next.
    """
    sizes = memory.sizes
    ends = jnp.cumsum(sizes)
    drawn = jax.random.randint(key, (batch,), 0, ends[-1])
    world = jnp.sum((drawn[:, None] >= ends[None]).astype(int), axis=1)
    age = drawn - (ends - sizes)[world]  # 0: the oldest

    def row(step: int) -> tuple[Array, Array]:
        later = age + step
        oldest = memory.added[world] - sizes[world]
        place = (oldest + jnp.minimum(later, sizes[world] - 1)) % memory.rows.shape[1]
        return memory.rows[world, place], later < sizes[world]

    first, _ = row(0)
    last, steps = first, jnp.ones(batch, dtype=int)
    rewards, open_ = [first[:, -3]], ~_ended(first)
    for step in range(1, n):
        found, known = row(step)
        goes_on = open_ & known
        last = jnp.where(goes_on[:, None], found, last)
        rewards.append(jnp.where(goes_on, found[:, -3], jnp.zeros_like(found[:, -3])))
        steps = steps + goes_on.astype(int)
        open_ = goes_on & ~_ended(found)
    return _batch(memory, first, last, jnp.stack(rewards, axis=1), steps)


def _ended(rows: Float[Array, "batch columns"]) -> Bool[Array, "batch"]:
    return (rows[:, -2] > 0) | (rows[:, -1] > 0)


def _batch(memory: Memory, first: Array, last: Array, rewards: Array, steps: Array) -> Recalled:
    m = memory.action_size
    d = (memory.rows.shape[2] - m - SCALARS) // 2
    return Recalled(
        observation=first[:, :d],
        action=first[:, d : d + m],
        rewards=rewards,
        next_observation=last[:, d + m : 2 * d + m],
        terminated=last[:, -2] > 0,
        steps=steps,
    )
