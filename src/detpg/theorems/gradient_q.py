"""Convergence of the critics of COPDAC-Q and COPDAC-GQ, actor at rest, off policy in earnest.

The learners' own updates are averaged over every transition; that map is affine, and what it must
do follows from matrices written out in NumPy.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from detpg import trees
from detpg.algorithms import COPDACGQ, COPDACQ
from detpg.policies import LinearPolicy
from detpg.theorems.enumerated import (
    BAIRD_GAMMA,
    BAIRD_THETA,
    BAIRD_V,
    Enumerated,
    Moments,
    baird,
    expected_update,
    moments,
    mspbe,
    mspbe_minimiser,
    ring_off_policy,
)
from detpg.theorems.record import (
    SIGMAS,
    Check,
    Group,
    Point,
    check,
    fitted_slope,
    points,
    relative_error,
    rounding,
)
from detpg.theorems.worlds import Linear
from detpg.types import Bounds, hyper_parameters

RING_THETA = np.array([0.2, -0.3, 0.4])
RING_SHIFT, RING_WIDTH = 0.6, 0.7
RING_STEP, BAIRD_STEP = 0.3, 0.05
X = "expected updates"
CRITIC_STEPS = ("alpha_w", "alpha_v", "alpha_u")
STORED = 100  # times at which the weights are kept
ALGORITHMS = {
    "COPDAC-Q": (COPDACQ, {}),
    "COPDAC-GQ, full": (COPDACGQ, {"correction": "full"}),
    "COPDAC-GQ, printed": (COPDACGQ, {"correction": "printed"}),
}


class Path(NamedTuple):
    """Weights (w, v) of the critic, one row for each time, and how many updates they have had."""

    updates: np.ndarray
    weights: np.ndarray


def follow(
    name: str,
    experience: Enumerated,
    theta: np.ndarray,
    v: np.ndarray,
    gamma: float,
    step: float,
    num_updates: int,
) -> Path:
    """Expected updates of one learner, all of its step sizes equal, from w = 0 and a given v."""
    algorithm, options = ALGORITHMS[name]
    parts: dict[str, Any] = {
        "policy": LinearPolicy(theta.size, 1),
        "state_value": Linear(theta.size),
        "bounds": Bounds.unbounded(1),
        "gamma": gamma,
        "alpha_theta": 0.0,
        **{size: step for size in hyper_parameters(algorithm) if size in CRITIC_STEPS},
    }
    learner = algorithm(**parts, **options)
    start = learner.init(jax.random.key(0))
    start = eqx.tree_at(lambda s: (s.theta, s.v), start, (jnp.asarray(theta)[None], jnp.asarray(v)))
    every = num_updates // STORED

    @jax.jit
    def loop(start):
        def update(_, state):
            return expected_update(learner, experience, state)

        def body(state, _):
            kept = trees.to_vector((state.w, state.v))
            return jax.lax.fori_loop(0, every, update, state), kept

        return jax.lax.scan(body, start, None, length=STORED)[1]

    return Path(every * np.arange(STORED), np.asarray(loop(start)))


def mean_map(name: str, known: Moments, gamma: float, step: float) -> np.ndarray:
    """The linear part of the expected update on (w, v), (w, v, u) or (w, v, u, z), written out."""
    n = known.A.shape[0]
    kept = {"COPDAC-Q": 0, "COPDAC-GQ, printed": n // 2, "COPDAC-GQ, full": n}[name]
    return np.eye(n + kept) - step * np.block(
        [
            [known.A, gamma * known.D.T[:, :kept]],
            [known.A[:kept], known.C[:kept, :kept]],
        ]
    )


def growth(matrix: np.ndarray) -> float:
    """Logarithm of the spectral radius: the rate at which a norm grows in the end."""
    return float(np.log(np.abs(np.linalg.eigvals(matrix)).max()))


def run() -> Group:
    """Where both converge, and Baird's star, where they do not."""
    ring_checks, ring_rows = _ring()
    star_checks, star_rows = _star()
    return Group(
        "Section 4.3: convergence of COPDAC-Q and COPDAC-GQ",
        (*ring_checks, *star_checks),
        (*ring_rows, *star_rows),
    )


def _ring() -> tuple[list[Check], list[Point]]:
    """Six places seen through three features, a behaviour off to a side."""
    theta = jnp.asarray(RING_THETA)[None]
    ring, experience = ring_off_policy(theta, RING_SHIFT, RING_WIDTH)
    known = moments(experience, RING_THETA, ring.gamma)
    minimiser = mspbe_minimiser(known)
    checks, rows = [], []
    for name in ALGORITHMS:
        zero = np.zeros(RING_THETA.size)
        path = follow(name, experience, RING_THETA, zero, ring.gamma, RING_STEP, 10_000)
        # A rounding of one update stays for as long as the slowest mode does.
        memory = -1 / growth(mean_map(name, known, ring.gamma, RING_STEP))
        checks.append(
            check(
                f"convergence/fixed-point/{_slug(name)}",
                f"{name}, off policy on the ring: its expected updates end at the minimiser of the "
                "MSPBE in closed form, relative distance 0 to rounding",
                relative_error(path.weights[-1], minimiser),
                0.0,
                rounding(memory),
            )
        )
        distance = [relative_error(x, minimiser) for x in path.weights]
        y = "ring: relative distance from the minimiser"
        rows += points(X, y, name, path.updates, distance)
    return checks, rows


def _slug(name: str) -> str:
    return name.lower().replace(", ", "-")


def _star() -> tuple[list[Check], list[Point]]:
    """Growth rates against the spectral radius; what full GQ does instead."""
    experience = baird()
    known = moments(experience, BAIRD_THETA, BAIRD_GAMMA)
    checks, rows, paths = [], [], {}
    for name in ALGORITHMS:
        paths[name] = path = follow(
            name, experience, BAIRD_THETA, BAIRD_V, BAIRD_GAMMA, BAIRD_STEP, 40_000
        )
        norms = np.linalg.norm(path.weights, axis=1)
        rows += points(X, "Baird's star: |(w, v)|", name, path.updates, norms)
        if name == "COPDAC-GQ, full":
            checks += _bounded(name, known, path)
            continue
        checks.append(
            check(
                f"convergence/baird/{_slug(name)}",
                f"{name} diverges on Baird's star: over {path.updates[-1]} expected updates "
                "|(w, v)| grows by a factor of at least 1e6",
                norms[-1] / norms[0],
                1e6,
                0.0,
                "at least",
            )
        )
        late = slice(3 * STORED // 4, None)  # when nothing but the fastest mode is left
        rate = fitted_slope(path.updates[late], np.log(norms[late]))
        expected = growth(mean_map(name, known, BAIRD_GAMMA, BAIRD_STEP))
        checks.append(
            check(
                f"convergence/baird/{_slug(name)}-rate",
                "and at the rate that the spectral radius of the mean update gives: logarithm of "
                "the growth for each update",
                rate.value,
                expected,
                SIGMAS * rate.error + rounding(),
            )
        )
    return checks, rows


def _bounded(name: str, known: Moments, path: Path) -> list[Check]:
    norms = np.linalg.norm(path.weights, axis=1)
    errors = np.sqrt(mspbe(known, path.weights))
    return [
        check(
            f"convergence/baird/{_slug(name)}",
            f"{name} does not: over {path.updates[-1]} expected updates |(w, v)| stays at most "
            "what it was at the start",
            norms[1:].max() / norms[0],
            1.0,
            0.0,
            "at most",
        ),
        check(
            f"convergence/baird/{_slug(name)}-mspbe",
            "and the root of its MSPBE falls to at most a thousandth",
            errors[-1] / errors[0],
            1e-3,
            0.0,
            "at most",
        ),
    ]
