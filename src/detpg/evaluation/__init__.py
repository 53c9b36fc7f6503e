"""Stop 6: what the learner is worth: greedy rollouts, and intervals over runs.

In: a learner's state, or numbers from independent runs. Out: returns, intervals.
Next: `detpg.experiments` judges claims by them.
"""

from detpg.evaluation.intervals import bootstrap_iqms, bootstrap_means, interval, iqm
from detpg.evaluation.rollout import greedy_return
from detpg.evaluation.statistics import Estimate, Summary, estimate, summarise

__all__ = [
    "Estimate",
    "Summary",
    "bootstrap_iqms",
    "bootstrap_means",
    "estimate",
    "greedy_return",
    "interval",
    "iqm",
    "summarise",
]
