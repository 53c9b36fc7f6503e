"""Bootstrap intervals over independent runs (never over points in time)."""

import numpy as np

NUM_RESAMPLES = 9_999
LEVEL = 0.95


def bootstrap_means(
    values: np.ndarray, seed: int, num_resamples: int = NUM_RESAMPLES
) -> np.ndarray:
    """Means of resampled runs.

    Args:
        values: Shape (..., runs). The same resampled runs serve every leading entry, so that what
            was measured on the same seeds is compared pair by pair.
        seed: Of the resampling.
        num_resamples: How many.

    Returns:
        Shape (..., resamples).
    """
    num_runs = values.shape[-1]
    return values @ _counts(num_runs, seed, num_resamples).T / num_runs


def bootstrap_iqms(values: np.ndarray, seed: int, num_resamples: int = NUM_RESAMPLES) -> np.ndarray:
    """Interquartile means of resampled runs, the same ones as of `bootstrap_means`.

    Args:
        values: Shape (..., runs).
        seed: Of the resampling.
        num_resamples: How many.

    Returns:
        Shape (..., resamples).
    """
    counts = _counts(values.shape[-1], seed, num_resamples)
    rows = [_middle_means(row, counts) for row in values.reshape(-1, values.shape[-1])]
    return np.stack(rows).reshape(*values.shape[:-1], num_resamples)


def iqm(values: np.ndarray) -> np.ndarray:
    """The interquartile mean: of the middle half of the runs (Agarwal et al., 2021).

    A quarter of the runs, rounded down, is left out at each end: of fewer than 4 it is the mean.

    Args:
        values: Finite, shape (..., runs).
    """
    num_runs = values.shape[-1]
    cut = num_runs // 4
    return np.asarray(np.sort(values, axis=-1)[..., cut : num_runs - cut].mean(axis=-1))


def interval(resampled: np.ndarray) -> tuple[float, float]:
    """The central 95% of a resampled statistic (percentile bootstrap).

    Args:
        resampled: Shape (resamples,).
    """
    tail = 100 * (1 - LEVEL) / 2
    low, high = np.percentile(resampled, [tail, 100 - tail], method="nearest")
    return float(low), float(high)


def _counts(num_runs: int, seed: int, num_resamples: int) -> np.ndarray:
    """How often each run is drawn, shape (resamples, runs)."""
    generator = np.random.default_rng(seed)
    return generator.multinomial(num_runs, np.full(num_runs, 1 / num_runs), num_resamples)


def _middle_means(values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """The IQM of each resample: of the sorted draws, those from `cut` to `num_runs - cut`."""
    order, num_runs = np.argsort(values), len(values)
    cut = num_runs // 4
    ranks = np.cumsum(counts[:, order], axis=1)
    kept = np.diff(np.clip(ranks, cut, num_runs - cut), axis=1, prepend=cut)
    return kept @ values[order] / (num_runs - 2 * cut)
