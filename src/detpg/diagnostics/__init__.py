"""Beside the road: how good one's own critic and actor's direction are, on one's own data.

In: a policy, a critic's action gradients, sampled directions. Out: the residuals of Theorem 3's two
conditions; bias, variance and cosine against the exact gradient; all with standard errors.
Next: the reader, who decides whether the actor may follow the critic.
"""

from detpg.diagnostics.compatibility import (
    Condition1,
    Condition2,
    action_gradients,
    condition_1,
    condition_2,
)
from detpg.diagnostics.gradients import (
    PolicyGradient,
    lqr_gradient,
    rollout_directions,
    rollout_gradient,
)
from detpg.diagnostics.quality import DirectionQuality, direction_quality

__all__ = [
    "Condition1",
    "Condition2",
    "DirectionQuality",
    "PolicyGradient",
    "action_gradients",
    "condition_1",
    "condition_2",
    "direction_quality",
    "lqr_gradient",
    "rollout_directions",
    "rollout_gradient",
]
