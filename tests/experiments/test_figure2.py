"""Figure 2's study: its design, its statistics by hand, its claims on made-up runs."""

import dataclasses

import numpy as np
import pytest

from detpg.experiments import STUDIES
from detpg.experiments.figure2 import ARMS, FIGURE2, HORIZONS
from detpg.experiments.figure2_claims import (
    COPDAC,
    SETTINGS,
    _probability_above,
    _wilson,
    judge,
)
from detpg.experiments.kernel_shards import run_kernel_shard, tile_coder
from detpg.experiments.published import published_curve
from detpg.experiments.selection import Choice, Selection
from detpg.experiments.study import Condition, Results
from detpg.experiments.sweep import plan

TASK = FIGURE2.conditions[0]
PAPER = {name: FIGURE2.presets["paper"].num_seeds(name) for name in ("sweep", "fresh", "interval")}


def test_every_learner_has_as_many_points_over_every_step_size_of_the_paper():
    assert STUDIES["figure2"] is FIGURE2
    sizes = {arm.name: len(arm.points()["alpha_v"]) for arm in ARMS}
    assert set(sizes.values()) == {240}
    for arm in ARMS:
        steps = {name for name in arm.names if name.startswith("alpha")}
        actor = {"alpha_theta", "alpha_w"} if "COPDAC" in arm.name else {"alpha_u", "alpha_y"}
        assert actor | {"alpha_v"} <= steps
    assert PAPER == {"sweep": 5, "fresh": 30, "interval": 100}


def test_as_printed_the_width_has_the_step_size_of_the_mean():
    for name in SETTINGS["as printed"].values():
        points = next(arm for arm in ARMS if arm.name == name).points()
        np.testing.assert_array_equal(points["alpha_y"], points["alpha_u"])


def test_the_mean_policy_is_played_twenty_times_from_start_to_end():
    for condition in FIGURE2.conditions:
        assert len(condition.times) == 20
        assert (condition.times[0], condition.steps) == (0, HORIZONS[condition.environment])
        x, *_ = published_curve("figure2", condition.environment, COPDAC)
        np.testing.assert_allclose(condition.times, x, atol=0.001 * condition.steps)


def test_published_ends():
    ends = {task: published_curve("figure2", task, COPDAC)[1][-1] for task in HORIZONS}
    assert ends == {"mountain-car": -292.76, "pendulum": 4413.2, "puddle-world": -2846}


def test_wilson_by_its_formula():
    n, k, z = 30, 13, 1.959964
    centre = (k / n + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z * np.sqrt(k / n * (1 - k / n) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)
    np.testing.assert_allclose(_wilson(k, n), (centre - half, centre + half), rtol=1e-5)


def test_probability_above_by_hand():
    """Of nine pairs 5 are above and 1 is equal; a lost run is below every other."""
    ours, theirs = np.array([1.0, 2.0, 3.0]), np.array([2.0, 0.0, 9.0])
    value, (low, high) = _probability_above(ours, theirs, seed=0)
    # 1 > 0; 2 = 2, 2 > 0; 3 > 2, 3 > 0
    assert value == pytest.approx(4.5 / 9)
    assert low <= value <= high
    value, _ = _probability_above(np.array([-np.inf, 1.0]), np.array([-5.0]), seed=0)
    assert value == 0.5


def results(final: dict[str, np.ndarray]) -> Results:
    """Made-up fresh runs: -5000 up to the last evaluation, then the given returns."""
    study = dataclasses.replace(FIGURE2, conditions=(TASK,))
    choice = Selection((Choice("mean", "mean", 0, 0.0, ()),), 0, 0)
    costs, points = {}, {}
    for name, values in final.items():
        runs = np.full((1, len(values), len(TASK.times)), 5000.0)
        runs[0, :, -1] = -values
        costs[TASK, name, "fresh"] = runs
        points[name] = {}
    selections = {(TASK, name): choice for name in final}
    return Results(study, selections, costs, {}, points, seed=0)


def claims(**levels: np.ndarray):
    printed, controlled = SETTINGS["as printed"], SETTINGS["controlled"]
    final = {COPDAC: levels["ours"]}
    final |= dict.fromkeys(printed.values(), levels["printed"])
    final |= dict.fromkeys(controlled.values(), levels["controlled"])
    return {claim.id: claim for claim in judge(results(final))}


def test_claims_follow_the_runs():
    noise = np.random.default_rng(0).normal(size=30)
    found = claims(ours=-130 + noise, printed=-3000 + noise, controlled=-110 + noise)
    assert found["at-least-as-good/baselines-as-printed"].verdict == "reproduced"
    assert found["at-least-as-good/baselines-controlled"].verdict == "not reproduced"
    solved = found["solved/mountain-car/copdac-q/baselines-as-printed"]
    assert (solved.measured, solved.verdict) == (1.0, "reproduced")
    first = found["first-solve/mountain-car/copdac-q/baselines-as-printed"]
    assert first.measured == 100_000
    assert found["untrained/mountain-car"].verdict == "reproduced"
    final = found["final/mountain-car/copdac-q/baselines-as-printed"]
    # the published -293 +- 162 reaches down to 25 and up to -610
    assert final.measured == pytest.approx(-130, abs=1)
    assert final.verdict == "reproduced"
    assert found["final/mountain-car/sac-as-printed/baselines-as-printed"].verdict == "reproduced"


def test_a_run_that_is_not_finite_is_counted_and_never_wins():
    noise = np.random.default_rng(0).normal(size=30)
    ours = np.where(np.arange(30) < 10, np.nan, -130 + noise)
    found = claims(ours=ours, printed=-140 + noise, controlled=-140 + noise)
    final = found["final/mountain-car/copdac-q/baselines-as-printed"]
    assert (final.num_runs, final.num_diverged, final.verdict) == (20, 10, "inconclusive")
    above = found["above/mountain-car/sac-as-printed"]
    assert above.measured == pytest.approx(2 / 3)
    assert found["solved/mountain-car/copdac-q/baselines-as-printed"].measured == 2 / 3


def shard(points: dict[str, np.ndarray], num_seeds: int = 3):
    condition = Condition("mountain-car", (), (0, 500, 1000))
    arm = dataclasses.replace(ARMS[0], grid=())
    (one,) = plan(condition, arm, "sweep", points, num_seeds, shape=(4, num_seeds), study_seed=5)
    return one


def test_a_shard_of_compiled_runs():
    """Untrained, the car stays in the valley; all points of a run meet the same noise."""
    point = {"alpha_theta": 0.1, "alpha_w": 0.3, "alpha_v": 1.0, "sigma": 0.5}
    twice = {name: np.array([value, value]) for name, value in point.items()}
    costs = run_kernel_shard(shard(twice))
    assert costs.shape == (2, 3, 3, 3)
    assert costs.dtype == np.float32
    # untrained: cost, steps of the episode, share of steps out of the legal range
    assert np.all(costs[:, :, 0] == [5000, 5000, 0])
    np.testing.assert_array_equal(costs[0], costs[1])
    other = run_kernel_shard(shard({name: values[:1] for name, values in twice.items()}, 2))
    np.testing.assert_array_equal(other[0], costs[0, :2])


def test_a_diverging_point_is_nan_to_the_end():
    wild = {"alpha_theta": 0.1, "alpha_w": 100.0, "alpha_v": 100.0, "sigma": 0.5}
    costs = run_kernel_shard(shard({name: np.array([value]) for name, value in wild.items()}))
    assert np.isnan(costs[:, :, -1, 0]).all()


def test_the_tile_coder_of_the_study():
    coder = tile_coder("pendulum")
    assert (coder.size, coder.num_active) == (1001, 11)
