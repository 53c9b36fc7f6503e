"""The baseline: both bandit learners as a plain NumPy loop, float64, one run at a time."""

import numpy as np


def numpy_copdac(
    generator: np.random.Generator, C: np.ndarray, alpha_theta: float, sigma: float, updates: int
) -> float:
    """COPDAC-B as one would write it down; returns the final cost of the mean."""
    m = len(C)
    theta, num_steps = np.zeros(m), 2 * m
    for _ in range(updates):
        phi = sigma * generator.standard_normal((num_steps, m))
        error = theta + phi - 4.0
        reward = -np.einsum("ni,ni->n", error @ C, error)
        design = np.column_stack([phi, np.ones(num_steps)])
        w = np.linalg.lstsq(design, reward, rcond=None)[0][:-1]
        theta = theta + alpha_theta * w
    return float((theta - 4.0) @ C @ (theta - 4.0))


def numpy_stochastic_ac(
    generator: np.random.Generator,
    C: np.ndarray,
    alpha_theta: float,
    alpha_y: float,
    sigma: float,
    updates: int,
) -> float:
    """SAC-B, score times Q, as one would write it down; returns the final cost of the mean."""
    m = len(C)
    theta, y, num_steps = np.zeros(m), 2 * np.log(sigma), 2 * m
    for _ in range(updates):
        width = np.exp(y / 2)
        noise = generator.standard_normal((num_steps, m))
        error = theta + width * noise - 4.0
        reward = -np.einsum("ni,ni->n", error @ C, error)
        score_theta = noise / width
        score_y = 0.5 * (np.einsum("ni,ni->n", noise, noise) - m)
        design = np.column_stack([score_theta, score_y, np.ones(num_steps)])
        value = design @ np.linalg.lstsq(design, reward, rcond=None)[0]
        theta = theta + alpha_theta * (score_theta.T @ value) / num_steps
        y = y + alpha_y * (score_y @ value) / num_steps
    return float((theta - 4.0) @ C @ (theta - 4.0))
