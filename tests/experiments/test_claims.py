import json
import math

import numpy as np
import pytest

from detpg.experiments.claims import Claim, above_one, ratio_of_means, within_factor
from detpg.experiments.published import published_curve, published_value


@pytest.mark.parametrize(
    ("bounds", "verdict"),
    [
        ((5, 20), "reproduced"),
        ((10 / 3, 30), "reproduced"),
        ((31, 40), "not reproduced"),
        ((1, 3), "not reproduced"),
        ((2, 20), "inconclusive"),
        ((20, 40), "inconclusive"),
        ((5, math.inf), "inconclusive"),
        ((31, math.inf), "inconclusive"),
    ],
)
def test_within_factor_of_ten(bounds, verdict):
    assert within_factor(10.0, bounds) == verdict


@pytest.mark.parametrize(
    ("bounds", "verdict"),
    [
        ((1.1, 2), "reproduced"),
        ((0.5, 0.9), "not reproduced"),
        ((0.9, 1.1), "inconclusive"),
        ((2, math.inf), "reproduced"),
        ((math.nan, 2), "inconclusive"),
    ],
)
def test_above_one(bounds, verdict):
    assert above_one(bounds) == verdict


def test_ratio_resamples_pairs():
    """Costs that differ by a factor on every seed have that ratio in every resample."""
    below = np.array([1.0, 10.0, 100.0])
    ratio = ratio_of_means(3 * below, below, seed=0)
    assert ratio.value == pytest.approx(3)
    assert ratio.interval == pytest.approx((3, 3))


def test_a_diverged_run_makes_the_ratio_infinite_not_silent():
    ratio = ratio_of_means(np.array([1.0, np.nan, 1.0]), np.ones(3), seed=0)
    assert math.isinf(ratio.value)
    assert math.isinf(ratio.interval[1])
    claim = Claim("i", "s", 2.0, ratio.value, ratio.interval, 3, "r", "inconclusive")
    assert json.loads(json.dumps(claim.as_json(), allow_nan=False))["measured"] is None


@pytest.mark.parametrize(("m", "ratio"), [(10, 1.96), (25, 15.5), (50, 417)])
def test_published_ratios_at_the_last_point(m: int, ratio: float):
    """The last plotted points, read off the table of the figure's points by hand."""
    values = [published_value("figure1", f"m={m}", s, 10_000) for s in ("SAC-B", "COPDAC-B")]
    assert values[0] / values[1] == pytest.approx(ratio, rel=0.01)


def test_published_curves_are_whole_or_refused():
    x, y = published_curve("figure1", "m=50", "COPDAC-B")
    assert len(x) == len(y) == 101
    assert x.min() == 100
    with pytest.raises(KeyError, match="m=11"):
        published_curve("figure1", "m=11", "SAC-B")
