"""`detpg.algorithms.StochasticAC` on tile-coded features, for compiled loops."""

import math

from detpg.algorithms import StochasticAC
from detpg.kernels.compiling import piece
from detpg.kernels.learners.learner import Learner, add, dot
from detpg.policies.feature_gaussian import LEAST_WIDTH

HYPER = ("gamma", "lambda_", "alpha_u", "alpha_y", "alpha_v", "sigma0")


@piece
def spread(weights, row, active, sigma0):
    """sigma0 exp(u_width^T x) + 1e-7."""
    return sigma0 * math.exp(dot(weights, row, active)) + LEAST_WIDTH


@piece
def behave(weights, active, hyper, mean, width):
    m = mean.size
    fixed = hyper[7] != 0
    for k in range(m):
        mean[k] = dot(weights, k, active)
        # A width that is never learnt needs no exponential.
        width[k] = hyper[5] + LEAST_WIDTH if fixed else spread(weights, m + k, active, hyper[5])


@piece
def learn(weights, active, next_active, deviation, width, reward, terminated, ended, hyper):
    gamma, lam, alpha_u, alpha_y, alpha_v = hyper[0], hyper[1], hyper[2], hyper[3], hyper[4]
    scaled, fixed = hyper[6] != 0, hyper[7] != 0
    m = deviation.size
    v, traces = 2 * m, 2 * m + 1
    # delta = r + gamma v^T x(s') - v^T x(s)
    delta = reward - dot(weights, v, active)
    if not terminated:
        delta += gamma * dot(weights, v, next_active)
    # e_v <- gamma lambda e_v + x;  v <- v + alpha_v delta e_v
    kept, decay = lam != 0, gamma * lam
    follow(weights, v, traces + v, kept, decay, 1.0, active, alpha_v * delta, ended)
    # e_u <- gamma lambda e_u + grad_u log pi_u(a|s);  u <- u + alpha_u delta e_u  (2, 3)
    for k in range(m):
        variance = width[k] * width[k]
        scale = 1.0 if scaled else 1.0 / variance
        score = deviation[k] * scale
        follow(weights, k, traces + k, kept, decay, score, active, alpha_u * delta, ended)
        if not fixed:
            row, score = m + k, (deviation[k] * deviation[k] - variance) * scale
            follow(weights, row, traces + row, kept, decay, score, active, alpha_y * delta, ended)


@piece
def follow(weights, row, trace, kept, decay, amount, active, step, ended):
    """Trace e <- decay e + amount x, weights <- weights + step e; e <- 0 where an episode ends.

    Where no trace is kept, only the active features change.
    """
    if kept:
        for i in range(weights.shape[1]):
            weights[trace, i] *= decay
            weights[row, i] += step * weights[trace, i]
        if ended:
            for i in range(weights.shape[1]):
                weights[trace, i] = 0
        else:
            add(weights, trace, active, amount)
    add(weights, row, active, step * amount)


LEARNER = Learner(
    algorithm=StochasticAC,
    hyper=HYPER,
    switches=(("gradient", "scaled"), ("fixed_std", True)),
    vectors=(
        ("mean", True),
        ("width", True),
        ("v", False),
        ("e_mean", True),
        ("e_width", True),
        ("e_v", False),
    ),
    behave=behave,
    learn=learn,
)
