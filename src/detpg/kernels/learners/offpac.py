"""`detpg.algorithms.OffPAC` on tile-coded features, for compiled loops."""

import math

from detpg.algorithms import OffPAC
from detpg.kernels.compiling import piece
from detpg.kernels.learners.learner import Learner, add, add_vector, dot, dot_vector
from detpg.kernels.learners.stochastic_ac import follow, spread

HYPER = (
    "gamma",
    "lambda_",
    "alpha_u",
    "alpha_y",
    "alpha_v",
    "alpha_w",
    "sigma0",
    "sigma",
)


@piece
def behave(weights, active, hyper, mean, width):
    # b = N(mu(s), sigma^2), around the learnt mean
    for k in range(mean.size):
        mean[k] = dot(weights, k, active)
        width[k] = hyper[7]


@piece
def learn(weights, active, next_active, deviation, width, reward, terminated, ended, hyper):
    gamma, lam, alpha_u, alpha_y = hyper[0], hyper[1], hyper[2], hyper[3]
    alpha_v, alpha_w = hyper[4], hyper[5]
    m = deviation.size
    v, w, traces = 2 * m, 2 * m + 1, 2 * m + 2
    e_v = traces + 2 * m
    # rho = pi_u(a|s) / b(a|s); from here on `width` is that of pi
    exponent, rho = 0.0, 1.0
    for k in range(m):
        sigma = spread(weights, m + k, active, hyper[6])
        here, there = deviation[k] / sigma, deviation[k] / width[k]
        exponent += 0.5 * (there * there - here * here)
        rho *= width[k] / sigma
        width[k] = sigma
    rho *= math.exp(exponent)

    # delta = r + gamma v^T x(s') - v^T x(s)
    delta = reward - dot(weights, v, active)
    if not terminated:
        delta += gamma * dot(weights, v, next_active)
    kept, decay = lam != 0, rho * gamma * lam
    if alpha_w != 0:
        # v <- v - alpha_v gamma (1 - lambda) (w^T e_v) x(s')
        # w <- w + alpha_w (delta e_v - (w^T x) x)
        of_x = dot(weights, w, active)
        of_trace = rho * of_x
        if kept:
            of_trace += decay * dot_vector(weights, w, e_v)
            add_vector(weights, w, alpha_w * delta * decay, e_v)
        add(weights, w, active, alpha_w * (delta * rho - of_x))
        if not terminated:
            add(weights, v, next_active, -alpha_v * gamma * (1 - lam) * of_trace)
    # e_v <- rho (x + gamma lambda e_v);  v <- v + alpha_v delta e_v
    follow(weights, v, e_v, kept, decay, rho, active, alpha_v * delta, ended)
    # e_u <- rho (grad_u log pi_u(a|s) + lambda e_u);  u <- u + alpha_u delta e_u  (4, 5)
    for k in range(m):
        error, row = deviation[k] / width[k], m + k
        score, decay = rho * error / width[k], rho * lam
        follow(weights, k, traces + k, kept, decay, score, active, alpha_u * delta, ended)
        score = rho * (error * error - 1.0)
        follow(weights, row, traces + row, kept, decay, score, active, alpha_y * delta, ended)


LEARNER = Learner(
    algorithm=OffPAC,
    hyper=HYPER,
    switches=(),
    vectors=(
        ("mean", True),
        ("width", True),
        ("v", False),
        ("w", False),
        ("e_mean", True),
        ("e_width", True),
        ("e_v", False),
    ),
    behave=behave,
    learn=learn,
)
