"""Every check is seen to fail: something behind it is broken on purpose."""

import json
from collections.abc import Callable
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest
from tests.theorems.sizes import SMALLER, failed

from detpg.actors import compatible_direction, deterministic_direction
from detpg.algorithms import COPDACQ
from detpg.critics import td_error
from detpg.environments import LQR
from detpg.features import score
from detpg.theorems import (
    behaviour_value,
    gradient_q,
    natural_gradient,
    off_policy,
    theorem_1,
    theorem_2,
    theorem_3,
    variance,
    worlds,
)
from detpg.theorems.worlds import Quadrature

COMMITTED = Path(__file__).parents[2] / "results" / "theorems" / "checks.json"
Patch = pytest.MonkeyPatch


class Wrong(LQR):
    """A regulator with a steeper Q, and with a kink in the second derivative of J."""

    def action_value(self, K, state, action):
        return 1.2 * super().action_value(K, state, action)

    def objective(self, K):
        off = K[0, 0] - 0.2  # 0 at the gain of the checks, where the gradient stays as it is
        return super().objective(K) + off * jnp.abs(off)


def wrong_regulator():
    world, gain = worlds.regulator()
    return Wrong(world.A, world.B, world.Q, world.R, world.noise, world.start, world.gamma), gain


def scaled(function: Callable, factor: float) -> Callable:
    """The same, a little too long."""
    return lambda *arguments: jax.tree.map(lambda x: factor * x, function(*arguments))


class Myopic(COPDACQ):
    """COPDAC-Q that takes every state for a terminal one."""

    def update(self, key, state, transition):
        last = jnp.ones_like(transition.terminated)
        return super().update(
            key, state, eqx.tree_at(lambda seen: seen.terminated, transition, last)
        )


def theorem_1_wrong_regulator(patch: Patch):
    patch.setattr(theorem_1, "regulator", wrong_regulator)


def theorem_2_score_too_long(patch: Patch):
    patch.setattr(theorem_2, "score", scaled(score, 1.01))


def theorem_3_directions_too_long(patch: Patch):
    patch.setattr(theorem_3, "compatible_direction", scaled(compatible_direction, 1.01))
    patch.setattr(theorem_3, "deterministic_direction", scaled(deterministic_direction, 1.02))
    patch.setattr(theorem_3, "AMOUNTS", tuple(1e-3 * 0.5**k for k in range(9)))


def theorem_3_critic_exact(patch: Patch):
    policy, known = theorem_3.problem()
    rows = jax.jit(lambda: theorem_3.jacobians(policy, known.theta, known.ring))()
    patch.setattr(theorem_3, "problem", lambda: (policy, known._replace(slopes=rows[:, 0])))


def off_policy_uphill_is_down(patch: Patch):
    patch.setattr(off_policy, "dropped", scaled(off_policy.dropped, 0.9))
    patch.setattr(off_policy, "deterministic_direction", scaled(deterministic_direction, -1.0))
    patch.setattr(off_policy, "best_gain", lambda world, gain: gain)


def off_policy_short_horizon(patch: Patch):
    def regulator():
        world, gain = worlds.regulator()
        short = LQR(world.A, world.B, world.Q, world.R, world.noise, world.start, gamma=0.05)
        return short, gain

    patch.setattr(off_policy, "regulator", regulator)


def variance_wrong_sizes(patch: Patch):
    def wrong_score(policy, parameters, s, action):
        size = jnp.sqrt(jnp.asarray(action.size, dtype=action.dtype))
        return scaled(score, size * jnp.exp(parameters.y / 2))(policy, parameters, s, action)

    def wrong_direction(policy, theta, s, q):
        return theta.shape[0] * deterministic_direction(policy, theta, s, q)

    patch.setattr(variance, "score", wrong_score)
    patch.setattr(variance, "deterministic_direction", wrong_direction)


def natural_gradient_wrong_parts(patch: Patch):
    fit = natural_gradient.least_squares
    patch.setattr(natural_gradient, "regulator", wrong_regulator)
    patch.setattr(natural_gradient, "score", scaled(score, 1.01))
    patch.setattr(natural_gradient, "least_squares", lambda *given: scaled(fit, 1.01)(*given))


def behaviour_myopic(patch: Patch):
    exact = worlds.gaussian()
    patch.setattr(behaviour_value, "COPDACQ", Myopic)
    patch.setattr(behaviour_value, "CHUNK", 200)
    # Noise with a mean: the bias is then of first order.
    patch.setattr(behaviour_value, "gaussian", lambda: Quadrature(exact.nodes + 0.1, exact.weights))


def behaviour_with_little_noise(patch: Patch):
    patch.setattr(behaviour_value, "RING_WIDTH", 0.1)
    patch.setattr(behaviour_value, "LQR_WIDTH", 0.1)
    patch.setitem(SMALLER, "behaviour", {"num_runs": 8})


def convergence_wrong_discount(patch: Patch):
    def wrong(reward, gamma, terminated, next_value, value):
        return td_error(reward, 0.9 * gamma, terminated, next_value, value)

    patch.setattr("detpg.algorithms.copdac_q.td_error", wrong)
    patch.setattr("detpg.algorithms.copdac_gq.td_error", wrong)


def convergence_no_correction(patch: Patch):
    patch.setitem(gradient_q.ALGORITHMS, "COPDAC-GQ, full", (COPDACQ, {}))


BEHAVIOUR = ("ring/value", "ring/slope", "lqr/value", "lqr/slope", "limit/value", "limit/slope")
FAULTS: tuple[tuple[Callable[[Patch], None], str, tuple[str, ...]], ...] = (
    (
        theorem_1_wrong_regulator,
        "theorem-1",
        ("closed-form", "finite-differences", "samples", "monte-carlo-rate"),
    ),
    (theorem_2_score_too_long, "theorem-2", ("gaussian", "bump", "polynomial", "skewed")),
    (
        theorem_3_directions_too_long,
        "theorem-3",
        (
            "compatible",
            "off-policy",
            "condition-1-broken",
            "condition-1-margin",
            "condition-2-broken",
            "condition-2-margin",
        ),
    ),
    (theorem_3_critic_exact, "theorem-3", ("critic-is-not-exact",)),
    (
        off_policy_uphill_is_down,
        "off-policy",
        ("identity", "ascent", "distance", "no-discount", "optimum"),
    ),
    (off_policy_short_horizon, "off-policy", ("dropped-term", "aliased")),
    (
        variance_wrong_sizes,
        "variance",
        (
            "width/q",
            "width/q-minus-v",
            "width/return-minus-v",
            "dimension/deterministic",
            "dimension/q",
            "dimension/q-minus-v",
        ),
    ),
    (natural_gradient_wrong_parts, "natural-gradient", ("network", "lqr", "fisher-limit")),
    (behaviour_myopic, "behaviour", BEHAVIOUR),
    (
        behaviour_with_little_noise,
        "behaviour",
        ("ring/not-the-target", "ring/not-its-slope", "lqr/not-the-target"),
    ),
    (
        convergence_wrong_discount,
        "convergence",
        (
            "fixed-point/copdac-q",
            "fixed-point/copdac-gq-full",
            "fixed-point/copdac-gq-printed",
            "baird/copdac-q",
            "baird/copdac-q-rate",
            "baird/copdac-gq-printed",
            "baird/copdac-gq-printed-rate",
        ),
    ),
    (
        convergence_no_correction,
        "convergence",
        ("baird/copdac-gq-full", "baird/copdac-gq-full-mspbe"),
    ),
)


@pytest.mark.slow
@pytest.mark.parametrize(("fault", "name", "caught"), FAULTS, ids=[f[0].__name__ for f in FAULTS])
def test_a_fault_is_caught(x64, monkeypatch: Patch, fault, name: str, caught: tuple[str, ...]):
    fault(monkeypatch)
    assert set(caught) <= failed(name)


def test_each_check_has_a_fault_that_it_catches():
    caught = {f"{name}/{check}" for _, name, checks in FAULTS for check in checks}
    assert caught == {check["id"] for check in json.loads(COMMITTED.read_text())["checks"]}
