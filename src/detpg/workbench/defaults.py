"""The settings that a learner has where nothing is typed: one record, and where each came from.

The paper's learners have those of `Config`. The learners that recall were chosen together, on tasks
and seeds that judge nothing (docs/decisions/0045); `AS_PUBLISHED` has those of the published code
instead.
"""

from types import MappingProxyType
from typing import Any

# Parts and normalisers of DDPG and TD3; their numbers stand beside their fields.
RECALLED: MappingProxyType[str, Any] = MappingProxyType(
    {
        "hidden": (128, 128),  # small enough for one core of a CPU
        "normalise": "both",  # observations by their deviation, rewards by that of returns
    }
)
DEFAULTS: MappingProxyType[str, MappingProxyType[str, Any]] = MappingProxyType(
    {"ddpg": RECALLED, "td3": RECALLED}
)


def defaults_of(algorithm: Any) -> dict[str, Any]:
    """Fields of `Config` that an algorithm has other defaults of."""
    return dict(DEFAULTS.get(algorithm, {}))
