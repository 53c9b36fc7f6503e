"""Stop 4: the critic, an estimate of Q or V and what it learns from (delta, w, v, u).

In: features and rewards. Out: weights, values.
Next: the actor reads its direction from them (`detpg.actors`).
"""

from detpg.critics.action_values import MLPActionValue, QuadraticActionValue
from detpg.critics.ensemble import EnsembleActionValues
from detpg.critics.regression import LinearFit, linear_regression
from detpg.critics.state_values import LinearStateValue, MLPStateValue, QuadraticStateValue
from detpg.critics.td import td_error

__all__ = [
    "EnsembleActionValues",
    "LinearFit",
    "LinearStateValue",
    "MLPActionValue",
    "MLPStateValue",
    "QuadraticActionValue",
    "QuadraticStateValue",
    "linear_regression",
    "td_error",
]
