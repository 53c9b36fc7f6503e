"""Stop 5: the actor's ascent direction, shaped like theta, without a step size.

In: the policy, its parameters, the critic's weights. Out: a direction.
Next: an algorithm (`detpg.algorithms`) takes the step.
"""

from detpg.actors.compatible import compatible_direction
from detpg.actors.deterministic import deterministic_direction
from detpg.actors.stochastic import gaussian_score, likelihood_ratio_direction

__all__ = [
    "compatible_direction",
    "deterministic_direction",
    "gaussian_score",
    "likelihood_ratio_direction",
]
