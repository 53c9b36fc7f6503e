import numpy as np

from detpg.evaluation import bootstrap_means, interval

NUM_RESAMPLES = 9_999


def test_the_same_runs_are_drawn_for_every_row():
    runs = np.random.default_rng(0).normal(size=12)
    means = bootstrap_means(np.stack([runs, runs + 5.0, -2 * runs]), seed=1)
    assert means.shape == (3, NUM_RESAMPLES)
    np.testing.assert_allclose(means[1] - means[0], 5.0, rtol=1e-12)
    np.testing.assert_allclose(means[2], -2 * means[0], rtol=0, atol=1e-12)
    assert np.std(means[0]) > 0.1


def test_resampling_follows_its_seed():
    runs = np.arange(7.0)
    assert np.array_equal(bootstrap_means(runs, seed=1), bootstrap_means(runs, seed=1))
    assert not np.array_equal(bootstrap_means(runs, seed=1), bootstrap_means(runs, seed=2))


def test_the_number_of_resamples_is_a_choice():
    assert bootstrap_means(np.arange(7.0), seed=1, num_resamples=5).shape == (5,)


def test_means_of_two_runs_are_the_three_that_there_are():
    means = bootstrap_means(np.asarray([0.0, 1.0]), seed=0)
    values, counts = np.unique(means, return_counts=True)
    assert values.tolist() == [0.0, 0.5, 1.0]
    # binomial shares of 1/4, 1/2, 1/4; the largest standard error is sqrt(1/4 / n)
    np.testing.assert_allclose(counts / NUM_RESAMPLES, [0.25, 0.5, 0.25], atol=4.5 / 2 / 99.99)


def test_the_interval_is_the_central_ninety_five_per_cent():
    shuffled = np.random.default_rng(0).permutation(np.arange(1001.0))
    assert interval(shuffled) == (25.0, 975.0)


def test_an_interval_that_reaches_a_lost_run_has_no_upper_end():
    assert interval(np.concatenate([np.zeros(900), np.full(100, np.inf)])) == (0.0, np.inf)
    assert interval(np.concatenate([np.zeros(990), np.full(10, np.inf)])) == (0.0, 0.0)


def test_the_interval_covers_the_mean_of_a_normal_as_often_as_it_says():
    repetitions, num_runs = 200, 100
    values = np.random.default_rng(11).normal(loc=3.0, size=(repetitions, num_runs))
    ends = np.asarray([interval(means) for means in bootstrap_means(values, seed=2)])
    covered = np.mean((ends[:, 0] <= 3.0) & (ends[:, 1] >= 3.0))
    error = np.sqrt(0.95 * 0.05 / repetitions)
    assert abs(covered - 0.95) < 4 * error
    # Coverage alone would let an interval be too wide. Against 2 * 1.96 sigma / sqrt(n): the
    # standard deviation's relative error is 1 / sqrt(2 n), its bias below 1 / n.
    width = np.mean(ends[:, 1] - ends[:, 0]) / (2 * 1.96 / np.sqrt(num_runs))
    assert abs(width - 1) < 4 / np.sqrt(2 * num_runs * repetitions) + 1 / num_runs
