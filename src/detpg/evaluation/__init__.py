"""Stop 6: what the learner is worth: greedy rollouts, and intervals over runs.

In: a learner's state, or numbers from independent runs. Out: returns, intervals.
Next: `detpg.experiments` judges claims by them.
"""

from detpg.evaluation.intervals import bootstrap_means, interval
from detpg.evaluation.rollout import greedy_return

__all__ = ["bootstrap_means", "greedy_return", "interval"]
