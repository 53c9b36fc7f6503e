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
    generator = np.random.default_rng(seed)
    counts = generator.multinomial(num_runs, np.full(num_runs, 1 / num_runs), num_resamples)
    return values @ counts.T / num_runs


def interval(resampled: np.ndarray) -> tuple[float, float]:
    """The central 95% of a resampled statistic (percentile bootstrap).

    Args:
        resampled: Shape (resamples,).
    """
    tail = 100 * (1 - LEVEL) / 2
    low, high = np.percentile(resampled, [tail, 100 - tail], method="nearest")
    return float(low), float(high)
