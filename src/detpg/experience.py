"""What an algorithm learns from: each transition once, fresh batches, or recalled batches."""

import dataclasses
from typing import Literal

import equinox as eqx
from jaxtyping import Array, Bool, Float, Int


@dataclasses.dataclass(frozen=True)
class Experience:
    """What experience an algorithm takes; the loops read it, and nothing else does.

    Attributes:
        kind: "each": one transition for each update, as it happens; "fresh": a batch of one-step
            episodes, drawn side by side; "recalled": batches drawn from a memory.
        batch: Transitions of an update.
        capacity: Transitions that a memory holds.
        warm_up: Steps of uniformly random actions before the first update.
        updates: For each step of the world.
        n: Steps whose rewards are summed before bootstrapping.
    """

    kind: Literal["each", "fresh", "recalled"] = "each"
    batch: int = 1
    capacity: int = 0
    warm_up: int = 0
    updates: int = 1
    n: int = 1

    @property
    def steps(self) -> int:
        """Steps of the world that one turn of the loop takes."""
        return self.batch if self.kind == "fresh" else 1


class Recalled(eqx.Module):
    """A batch from a memory: each row starts at a step drawn at random and spans up to n steps.

    Attributes:
        observation: s, where the row starts.
        action: a, as it was carried out, in units of the box.
        rewards: r of the steps spanned, in order; 0 after the last of them.
        next_observation: Where the last of them led, before any reset.
        terminated: Whether that is terminal.
        steps: How many are spanned: fewer than n where the episode, or what is known of it, ended.
    """

    observation: Float[Array, "batch obs"]
    action: Float[Array, "batch act"]
    rewards: Float[Array, "batch n"]
    next_observation: Float[Array, "batch obs"]
    terminated: Bool[Array, "batch"]
    steps: Int[Array, "batch"]
