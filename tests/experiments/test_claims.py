import json
import math

import numpy as np
import pytest

from detpg.experiments.claims import Claim, Ratio, above_one, ratio_of_means, within_factor
from detpg.experiments.published import published_curve, published_value


def ratio_with(bounds, num_runs: int = 5, num_diverged: int = 0) -> Ratio:
    """A ratio whose resamples are spread evenly so that its interval has these ends."""
    low, high = bounds
    resampled = np.repeat([low, high], 500)
    return Ratio((low + high) / 2, resampled, num_runs, num_diverged)


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
        ((math.nan, math.nan), "inconclusive"),
    ],
)
def test_within_a_factor_of_a_published_ten(bounds, verdict):
    assert within_factor(10.0, ratio_with(bounds)) == verdict


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
    assert above_one(ratio_with(bounds)) == verdict


def test_many_lost_runs_make_every_verdict_inconclusive():
    for num_diverged, sure in ((5, True), (6, False)):
        ratio = ratio_with((5, 20), num_runs=100 - num_diverged, num_diverged=num_diverged)
        assert (within_factor(10.0, ratio) == "reproduced") == sure
        assert (above_one(ratio) == "reproduced") == sure


def test_ratio_resamples_pairs():
    """Costs that differ by a factor on every seed have that ratio in every resample."""
    below = np.array([1.0, 10.0, 100.0])
    ratio = ratio_of_means(3 * below, below, seed=0)
    assert ratio.value == pytest.approx(3)
    assert ratio.interval == pytest.approx((3, 3))


def test_a_diverged_run_is_left_out_and_counted():
    ratio = ratio_of_means(np.array([3.0, np.nan, 3.0, 9.0]), np.array([1, 1, 1, np.inf]), seed=0)
    assert ratio.value == pytest.approx(3)
    assert (ratio.num_runs, ratio.num_diverged) == (2, 2)


def test_if_all_diverged_there_is_no_number():
    ratio = ratio_of_means(np.full(3, np.nan), np.ones(3), seed=0)
    claim = Claim("i", "s", 2.0, ratio.value, ratio.interval, 0, 3, "r", "inconclusive")
    record = json.loads(json.dumps(claim.as_json(), allow_nan=False))
    assert record["measured"] is None
    assert record["interval"] == [None, None]
    assert within_factor(2.0, ratio) == above_one(ratio) == "inconclusive"


@pytest.mark.parametrize(("m", "ratio"), [(10, 1.2), (25, 16.6), (50, 499)])
def test_published_ratios_at_the_end(m: int, ratio: float):
    """Means of the last ten plotted points, by hand from the table of the figure's points."""
    values = [published_value("figure1", f"m={m}", s, 10_000, 10) for s in ("SAC-B", "COPDAC-B")]
    assert values[0] / values[1] == pytest.approx(ratio, rel=0.01)


def test_the_published_point_at_600_steps():
    assert published_value("figure1", "m=50", "SAC-B", 600) == pytest.approx(70.7, rel=0.01)


def test_published_curves_are_whole_or_refused():
    x, y = published_curve("figure1", "m=50", "COPDAC-B")
    assert len(x) == len(y) == 101
    assert x.min() == 100
    with pytest.raises(KeyError, match="m=11"):
        published_curve("figure1", "m=11", "SAC-B")
