"""Around a learner: normalisers, meters, several worlds at once, and what is deployed.

In: an algorithm. Out: an algorithm whose state carries more, or the controller that was learnt.
Next: the loop over time (`detpg.training`), which sees no difference.
"""

from detpg.wrappers.controller import Controller
from detpg.wrappers.metered import Meter, Metered, MeteredState
from detpg.wrappers.normalised import Moments, Normalised, NormalisedState
from detpg.wrappers.several import of_each_world, several_worlds

__all__ = [
    "Controller",
    "Meter",
    "Metered",
    "MeteredState",
    "Moments",
    "Normalised",
    "NormalisedState",
    "of_each_world",
    "several_worlds",
]
