"""What a learner will hold, counted before anything of it is laid out."""

import math
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from detpg.experience import Experience
from detpg.machine import memory
from detpg.memory import num_bytes
from detpg.types import Algorithm, EnvironmentSpec
from detpg.workbench.config import Config

# Numbers of one learner. Each step touches all of them: more take half a second a step, and days
# for a run of 100,000 (docs/decisions/0035).
MOST = 2**26
# Of a learner's numbers while it learns: its state, what a step works with, what is kept.
COPIES = 16
KEPT = 3  # of a memory, while it is written to a checkpoint or read from one
SMALLER = {
    "tiles": "let tiles share weights with --hashed 65536, or give fewer --tiles or --tilings",
    "quadratic": "choose a part that is not quadratic: that grows with the square of what is "
    "observed",
    "mlp": "give fewer --hidden or --value-units",
    "linear": "let the world observe fewer numbers",
}
UNITS = ("bytes", "kB", "MB", "GB", "TB", "PB", "EB")


def check_tiles(config: Config, dimensions: int) -> None:
    """Refuses tiles that are too many; exact, however many they are.

    Raises:
        ValueError: How many weights and bytes, and what to do.
    """
    weights = config.tilings * config.tiles**dimensions
    if config.hashed is None and weights > MOST:
        raise ValueError(
            f"{config.tilings} tilings of {config.tiles}^{dimensions} tiles are {_count(weights)} "
            f"weights, {_bytes(weights * _item())}, for each action component or value, and "
            f"{_bytes(weights * _item() * COPIES)} while it learns, where {_limit()}: "
            f"{SMALLER['tiles']}."
        )


def check_size(config: Config, parts: Mapping[str, Any], learner: Algorithm | None = None) -> None:
    """Refuses a learner that does not fit into the memory, or is too large to learn in days.

    Args:
        config: Of the run.
        parts: Name -> policy, value or features.
        learner: Made of them, with all that it carries; not made yet: its parts' weights count.

    Raises:
        ValueError: How many numbers and bytes, of which parts, and what to do.
    """
    counts = {name: _weights(part) for name, part in parts.items()}
    numbers = sum(counts.values()) if learner is None else _held(learner)
    one, free = numbers * _item() * COPIES, memory()
    needed = one * config.seeds
    if numbers <= MOST and (free is None or needed <= free):
        return
    listed = ", ".join(f"{_count(n)} in its {name.replace('_', ' ')}" for name, n in counts.items())
    learns = "learns" if config.seeds == 1 else "learn"
    few = numbers <= MOST and one <= (free or 0)
    mend = "give fewer --seeds" if few else _smaller(config, max(counts, key=counts.__getitem__))
    raise ValueError(
        f"{config.algorithm} would hold {_count(numbers)} numbers ({listed}), "
        f"{_bytes(needed)} while {_seeds(config)} {learns}, where {_limit()}: {mend}."
    )


def check_memory(config: Config, taken: Experience, spec: EnvironmentSpec) -> None:
    """Refuses a memory of transitions that this machine cannot hold.

    Raises:
        ValueError: How many bytes it would take, how many are free, and what to do.
    """
    needed, free = KEPT * _held_in_memory(config, taken, spec), memory()
    if free is None or needed <= free:
        return
    rows = min(taken.capacity, config.steps)
    fitting = rows * free // needed // 2
    raise ValueError(
        f"A memory of {rows:,} transitions takes {_bytes(needed)} for {_seeds(config)} while it is "
        f"saved or resumed, where {_bytes(free)} are free: give a smaller one, such as --memory "
        f"{max(fitting, 1)}."
    )


def told_of_memory(config: Config, taken: Experience, spec: EnvironmentSpec) -> list[str]:
    """What a user is told before a learner that recalls starts."""
    if taken.kind != "recalled":
        return []
    rows, size = min(taken.capacity, config.steps), _held_in_memory(config, taken, spec)
    return [f"The memory of {rows:,} transitions takes {_bytes(size)} for {_seeds(config)}."]


def _held_in_memory(config: Config, taken: Experience, spec: EnvironmentSpec) -> int:
    rows, sizes = min(taken.capacity, config.steps), (spec.observation_size, spec.action_size)
    return config.seeds * num_bytes(rows, *sizes, config.num_envs)


def _seeds(config: Config) -> str:
    return "1 learner" if config.seeds == 1 else f"{config.seeds:,} learners"


def _weights(part: Any) -> int:
    if not hasattr(part, "init"):  # features
        return part.size
    return _total(jax.eval_shape(part.init, jax.random.key(0)))


def _held(learner: Algorithm) -> int:
    return _total(jax.eval_shape(learner.init, jax.random.key(0)))


def _total(tree: PyTree) -> int:
    return sum(math.prod(leaf.shape) for leaf in jax.tree.leaves(tree))


def _smaller(config: Config, part: str) -> str:
    """What makes the part smaller."""
    kind = config.policy if part in ("policy", "features") else config.value
    if kind == "auto":
        kind = "quadratic" if part == "features" else "mlp"
    return SMALLER.get(kind, "give a smaller policy")


def _limit() -> str:
    free = memory()
    most = f"a learner of more than {MOST:,} would take days"
    return most if free is None else f"{_bytes(free)} are free and {most}"


def _item() -> int:
    return jnp.zeros(()).dtype.itemsize


def _count(number: int) -> str:
    return f"{number:,}" if number < 10**15 else f"some 10^{_magnitude(number)}"


def _bytes(size: int) -> str:
    power = min(_magnitude(max(size, 1)) // 3, len(UNITS) - 1)
    tenths = size * 10 // 1000**power
    if tenths >= 10**5:
        return f"some 10^{_magnitude(size)} bytes"
    return f"{tenths // 10}.{tenths % 10} {UNITS[power]}" if power else f"{size} bytes"


def _magnitude(number: int) -> int:
    """Of its first digit: 3 for 1000; of a number with thousands of digits too."""
    return int(math.log10(number))
