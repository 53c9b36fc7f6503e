"""What an exported file is once it was read."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float


@dataclasses.dataclass(frozen=True)
class Loaded:
    """Observation in, action out, both in the world's units: one, or a batch of them.

    Attributes:
        about: What the file says of itself: versions, algorithm, environment, bounds.
        run: From a batch of observations to one of actions, float32.
    """

    about: dict[str, Any]
    run: Callable[[np.ndarray], Any]

    def __call__(self, observation: Float[Any, "*batch obs"]) -> Float[np.ndarray, "*batch act"]:
        seen = np.asarray(observation, np.float32)
        size = self.about["observation_size"]
        if seen.ndim not in (1, 2) or seen.shape[-1] != size:
            raise ValueError(
                f"The observation has shape {seen.shape}: give ({size},), or (N, {size}) for N of "
                "them."
            )
        actions = np.asarray(self.run(np.atleast_2d(seen)))
        return actions if seen.ndim == 2 else actions[0]
