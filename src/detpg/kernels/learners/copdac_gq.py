"""`detpg.algorithms.COPDACGQ` on tile-coded features, for compiled loops."""

from detpg.algorithms import COPDACGQ
from detpg.kernels.compiling import piece
from detpg.kernels.learners.copdac_q import behave
from detpg.kernels.learners.learner import Learner, add, add_vector, dot

HYPER = ("gamma", "alpha_theta", "alpha_w", "alpha_v", "sigma", "alpha_u")


@piece
def learn(weights, active, next_active, deviation, width, reward, terminated, ended, hyper):
    gamma, alpha_theta, alpha_w, alpha_v, alpha_u = hyper[0], hyper[1], hyper[2], hyper[3], hyper[5]
    natural, printed = hyper[6] != 0, hyper[7] != 0
    m = deviation.size
    u, v, z = 2 * m, 3 * m, 3 * m + 1
    # delta = r + gamma V(s') - (phi(s, a)^T w + V(s))  (23); psi^T h
    delta = reward - dot(weights, v, active)
    if not terminated:
        delta += gamma * dot(weights, v, next_active)
    expected = dot(weights, z, active)
    for k in range(m):
        slope = dot(weights, m + k, active)
        delta -= deviation[k] * slope
        expected += deviation[k] * dot(weights, u + k, active)
        # theta <- theta + alpha_theta grad mu (grad mu^T w), or along w itself  (24)
        if natural:
            add_vector(weights, k, alpha_theta, m + k)
        else:
            add(weights, k, active, alpha_theta * slope)
    # w <- w + alpha_w delta phi(s, a)  (25);  u <- u + alpha_u (delta - psi^T h) phi(s, a)  (27)
    for k in range(m):
        add(weights, m + k, active, alpha_w * delta * deviation[k])
        add(weights, u + k, active, alpha_u * (delta - expected) * deviation[k])
    # v <- v + alpha_v (delta phi(s) - gamma phi(s') (psi^T h))  (26)
    add(weights, v, active, alpha_v * delta)
    if not terminated:
        add(weights, v, next_active, -alpha_v * gamma * expected)
    if not printed:
        add(weights, z, active, alpha_u * (delta - expected))


LEARNER = Learner(
    algorithm=COPDACGQ,
    hyper=HYPER,
    switches=(("natural", True), ("correction", "printed")),
    vectors=(("theta", True), ("w", True), ("u", True), ("v", False), ("z", False)),
    behave=behave,
    learn=learn,
)
