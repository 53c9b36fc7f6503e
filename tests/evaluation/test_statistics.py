import numpy as np
import pytest
from scipy.stats import t, trim_mean

from detpg.evaluation import bootstrap_iqms, bootstrap_means, estimate, interval, iqm, summarise

VALUES = np.random.default_rng(3).normal(size=(4, 11))


@pytest.mark.parametrize("num_runs", range(1, 14))
def test_the_iqm_is_scipy_s_trimmed_mean(num_runs):
    values = np.random.default_rng(num_runs).normal(size=(3, num_runs))
    np.testing.assert_allclose(iqm(values), trim_mean(values, 0.25, axis=-1), rtol=1e-14)


def test_the_iqm_does_not_see_the_outer_quarters():
    assert iqm(np.asarray([-1e9, 1.0, 2.0, 3.0, 1e9, 3.0, 1.0, 5.0])) == np.mean([1.0, 2.0, 3.0, 3])


@pytest.mark.parametrize("num_runs", [1, 2, 3, 4, 5, 8, 11])
def test_resampled_statistics_are_those_of_drawn_runs_written_out(num_runs):
    values, num_resamples = VALUES[:, :num_runs], 50
    generator = np.random.default_rng(7)
    counts = generator.multinomial(num_runs, np.full(num_runs, 1 / num_runs), num_resamples)
    drawn = np.stack([np.repeat(values, times, axis=-1) for times in counts])
    means = bootstrap_means(values, 7, num_resamples)
    np.testing.assert_allclose(means, drawn.mean(axis=-1).T, rtol=0, atol=1e-14)
    iqms = bootstrap_iqms(values, 7, num_resamples)
    np.testing.assert_allclose(iqms, trim_mean(drawn, 0.25, axis=-1).T, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("statistic", "resampled", "of"),
    [("mean", bootstrap_means, np.mean), ("iqm", bootstrap_iqms, iqm)],
)
def test_an_estimate_is_made_row_by_row(statistic, resampled, of):
    found = estimate(VALUES, statistic, seed=2)
    for row, values in enumerate(VALUES):
        assert found.value[row] == of(values)
        ends = interval(resampled(values, 2))
        np.testing.assert_allclose((found.low[row], found.high[row]), ends, rtol=1e-14)
    assert np.all((found.low < found.value) & (found.value < found.high))


def test_of_one_run_there_is_no_interval():
    found = estimate(np.asarray([[2.0], [3.0]]), "iqm")
    assert found.value.tolist() == [2.0, 3.0]
    assert np.isnan([found.low, found.high]).all()


def test_several_runs_are_resampled_and_scored_by_their_mean():
    returns = [np.asarray([0.0, 2.0]), np.asarray([3.0, 5.0, 7.0]), np.asarray([4.0])]
    found = summarise(returns, seed=4)
    scores = np.asarray([1.0, 5.0, 4.0])
    assert (found.over, found.num_scores, found.num_lost) == ("runs", 3, 0)
    assert found.mean == estimate(scores, "mean", 4)
    assert found.iqm == estimate(scores, "iqm", 4)


def test_of_one_run_the_episodes_are_resampled():
    found = summarise([VALUES[0]], seed=4)
    assert (found.over, found.num_scores) == ("episodes", 11)
    assert found.iqm == estimate(VALUES[0], "iqm", 4)


def test_what_is_not_finite_is_left_out_and_counted():
    runs = [np.asarray([1.0, 2.0]), np.asarray([np.nan, 2.0]), np.asarray([np.inf, -np.inf])]
    found = summarise([*runs, np.asarray([3.0])])
    assert (found.num_scores, found.num_lost) == (4, 2)
    assert found.mean.value == 2.25
    alone = summarise([np.asarray([np.nan])])
    assert (alone.num_lost, np.isnan(alone.mean.value)) == (1, True)


def coverage(num_runs, num_episodes, between, statistic, repetitions):
    """How often the interval over runs covers the truth, 0, of both statistics."""
    generator = np.random.default_rng(num_runs)
    runs = between * generator.normal(size=(repetitions, num_runs, 1))
    returns = runs + generator.normal(size=(repetitions, num_runs, num_episodes))
    found = estimate(returns.mean(axis=-1), statistic, num_resamples=999)
    return np.mean((found.low <= 0) & (found.high >= 0))


@pytest.mark.parametrize("statistic", ["mean", "iqm"])
@pytest.mark.parametrize("between", [0.0, 1.0])
def test_the_interval_over_runs_covers_the_truth_as_often_as_it_says(statistic, between):
    """Also where the episodes are noisier than the runs, with which their noise comes along."""
    repetitions = 400
    covered = coverage(80, 5, between, statistic, repetitions)
    assert abs(covered - 0.95) < 4 * np.sqrt(0.95 * 0.05 / repetitions)


@pytest.mark.parametrize(("num_runs", "said"), [(5, 0.84), (10, 0.90), (30, 0.94)])
def test_with_few_runs_it_covers_it_less_often_as_the_page_says(num_runs, said):
    """The bootstrap's variance lacks (n - 1) / n, and the normal's 1.96 is not Student's."""
    expected = 1 - 2 * t.sf(1.96 * np.sqrt((num_runs - 1) / num_runs), num_runs - 1)
    assert abs(expected - said) < 0.01
    repetitions = 1_000
    covered = coverage(num_runs, 1, 1.0, "mean", repetitions)
    assert abs(covered - expected) < 4 * np.sqrt(expected * (1 - expected) / repetitions)
