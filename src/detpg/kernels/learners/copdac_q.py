"""`detpg.algorithms.COPDACQ` on tile-coded features, for compiled loops."""

from detpg.algorithms import COPDACQ
from detpg.kernels.compiling import piece
from detpg.kernels.learners.learner import Learner, add, add_vector, dot

HYPER = ("gamma", "alpha_theta", "alpha_w", "alpha_v", "sigma")


@piece
def behave(weights, active, hyper, mean, width):
    # a ~ beta(.|s) = N(mu_theta(s), sigma^2)
    for k in range(mean.size):
        mean[k] = dot(weights, k, active)
        width[k] = hyper[4]


@piece
def learn(weights, active, next_active, deviation, width, reward, terminated, ended, hyper):
    gamma, alpha_theta, alpha_w, alpha_v = hyper[0], hyper[1], hyper[2], hyper[3]
    natural = hyper[5] != 0
    m = deviation.size
    v = 2 * m
    # delta = r + gamma V(s') - (phi(s, a)^T w + V(s))  (19)
    delta = reward - dot(weights, v, active)
    if not terminated:
        delta += gamma * dot(weights, v, next_active)
    for k in range(m):
        slope = dot(weights, m + k, active)
        delta -= deviation[k] * slope
        # theta <- theta + alpha_theta grad mu (grad mu^T w), or along w itself  (20)
        if natural:
            add_vector(weights, k, alpha_theta, m + k)
        else:
            add(weights, k, active, alpha_theta * slope)
    # w <- w + alpha_w delta phi(s, a)  (21)
    for k in range(m):
        add(weights, m + k, active, alpha_w * delta * deviation[k])
    # v <- v + alpha_v delta phi(s)  (22)
    add(weights, v, active, alpha_v * delta)


LEARNER = Learner(
    algorithm=COPDACQ,
    hyper=HYPER,
    switches=(("natural", True),),
    vectors=(("theta", True), ("w", True), ("v", False)),
    behave=behave,
    learn=learn,
)
