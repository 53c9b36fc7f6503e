"""Stop 4: the critic, an estimate of Q or V and what it learns from (delta, w, v, u).

In: features and rewards. Out: weights, values.
Next: the actor reads its direction from them (`detpg.actors`).
"""

from detpg.critics.regression import LinearFit, linear_regression

__all__ = ["LinearFit", "linear_regression"]
