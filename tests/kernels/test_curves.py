"""Whole learning curves against RLPark's: task, tiles, learner, loop and evaluation at once."""

import numpy as np
import pytest

from benchmarks_data import columns
from detpg.kernels import run

# alpha_v, alpha_u, width in the task's own units, first and last step of what is compared: before
# that some runs of the puddle world fail, after it some of the pendulum.
CURVES = [
    ("offpac_pendulum_av.1_au.001", "pendulum", "offpac", 0.1, 0.001, 2.0, 25_000, 150_000),
    ("sac_puddle_raw_s.025", "puddle-world", "stochastic-ac", 0.5, 1e-6, 0.025, 100_000, 300_000),
    ("offpac_puddle_raw_s.025", "puddle-world", "offpac", 0.1, 1e-6, 0.025, 100_000, 300_000),
]


@pytest.mark.parametrize(
    ("name", "task", "learner", "alpha_v", "alpha_u", "width", "first", "last"), CURVES
)
def test_a_curve_of_the_authors_library(name, task, learner, alpha_v, alpha_u, width, first, last):
    """At every recorded step, within 4.5 standard errors of the difference of the means."""
    recorded = columns(f"curve_{name}")
    steps = recorded["train_steps"]
    keep = (first <= steps) & (steps <= last)
    at = steps[keep].astype(int)
    assert len(at) >= 6
    sizes = {"alpha_v": alpha_v / 11, "alpha_u": alpha_u / 11, "alpha_y": alpha_u / 11}
    widths = {"sigma0": width} | ({"sigma": width} if learner == "offpac" else {})
    found = run(
        task,
        learner,
        sizes | widths,
        runs=range(60),
        horizon=int(at[-1]),
        evaluate_at=at,
        scaled=False,
    ).returns[0]
    error = np.hypot(found.std(axis=0, ddof=1) / np.sqrt(60), recorded["stderr"][keep])
    gap = found.mean(axis=0) - recorded["mean"][keep]
    assert np.all(np.abs(gap) < 4.5 * error)
