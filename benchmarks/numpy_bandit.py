"""The baseline: both bandit learners as a plain NumPy loop, float64, one run at a time."""

from collections.abc import Callable

import numpy as np

Fit = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, float]]


def by_lstsq(features: np.ndarray, reward: np.ndarray) -> tuple[np.ndarray, float]:
    """Slope and bias as one would write it down first."""
    design = np.column_stack([features, np.ones(len(features))])
    weights = np.linalg.lstsq(design, reward, rcond=None)[0]
    return weights[:-1], weights[-1]


def by_normal_equations(features: np.ndarray, reward: np.ndarray) -> tuple[np.ndarray, float]:
    """Slope and bias from the centred Gram matrix, the same arithmetic as detpg's."""
    centre, level = features.mean(axis=0), reward.mean()
    centred = features - centre
    width = centred.std(axis=0)
    standard = centred / width
    w = np.linalg.solve(standard.T @ standard, standard.T @ (reward - level)) / width
    return w, level - centre @ w


def numpy_copdac(
    generator: np.random.Generator,
    fit: Fit,
    C: np.ndarray,
    updates: int,
    alpha_theta: float = 0.1,
    sigma: float = 0.1,
) -> float:
    """COPDAC-B; returns the final cost of the mean."""
    m = len(C)
    theta = np.zeros(m)
    for _ in range(updates):
        phi = sigma * generator.standard_normal((2 * m, m))
        error = theta + phi - 4.0
        reward = -np.einsum("ni,ni->n", error @ C, error)
        w, _ = fit(phi, reward)
        theta = theta + alpha_theta * w
    return float((theta - 4.0) @ C @ (theta - 4.0))


def numpy_stochastic_ac(
    generator: np.random.Generator,
    fit: Fit,
    C: np.ndarray,
    updates: int,
    alpha_theta: float = 0.01,
    alpha_y: float = 1e-4,
    sigma: float = 1.0,
) -> float:
    """SAC-B, score times Q; returns the final cost of the mean."""
    m = len(C)
    theta, y = np.zeros(m), 2 * np.log(sigma)
    for _ in range(updates):
        width = np.exp(y / 2)
        noise = generator.standard_normal((2 * m, m))
        error = theta + width * noise - 4.0
        reward = -np.einsum("ni,ni->n", error @ C, error)
        score_theta = noise / width
        score_y = 0.5 * (np.einsum("ni,ni->n", noise, noise) - m)
        features = np.column_stack([score_theta, score_y])
        w, bias = fit(features, reward)
        direction = features.T @ (features @ w + bias) / (2 * m)
        theta, y = theta + alpha_theta * direction[:m], y + alpha_y * direction[m]
    return float((theta - 4.0) @ C @ (theta - 4.0))
