"""COPDAC-Q and COPDAC-GQ: hand numbers, and what they learn on the LQR."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.algorithms import COPDACGQ, COPDACQ
from detpg.algorithms.copdac_gq import COPDACGQState
from detpg.algorithms.copdac_q import COPDACQState
from detpg.critics import LinearStateValue, MLPStateValue
from detpg.environments import LQR
from detpg.features import QuadraticFeatures
from detpg.policies import LinearPolicy
from detpg.theorems.behaviour_value import OneStep
from detpg.training import train
from detpg.types import Bounds, Transition


class Weight:
    """V^v(s) = v . s, so that phi(s) = s."""

    def init(self, key):
        return jnp.zeros(2)

    def __call__(self, v, observation):
        return jnp.dot(v, observation)


WEIGHT = Weight()
UNBOUNDED = Bounds.unbounded(1)
PARTS = {"policy": LinearPolicy(2, 1), "state_value": WEIGHT, "bounds": UNBOUNDED}
REST = jnp.zeros(1)
STEPS = {"gamma": 0.5, "alpha_theta": 0.1, "alpha_w": 0.2, "alpha_v": 0.4}


def transition(terminated: bool = False) -> Transition:
    """s = (1, 2), a = 3, r = 4, s' = (2, 0)."""
    return Transition(
        observation=jnp.asarray([1.0, 2.0]),
        action=jnp.asarray([3.0]),
        reward=jnp.asarray(4.0),
        next_observation=jnp.asarray([2.0, 0.0]),
        next_action=jnp.asarray([0.0]),
        terminated=jnp.asarray(terminated),
    )


@pytest.mark.parametrize(("terminated", "delta"), [(False, 0.0), (True, -1.0)])
def test_copdac_q_by_hand(terminated: bool, delta: float):
    """mu = 0.5*1 + 0.25*2 = 1; phi = 2 s; Q = w.phi + v.s = 2*(0.5*1+0.5*2) + 1*1+0.5*2 = 5."""
    learner = COPDACQ(**PARTS, **STEPS)
    state = COPDACQState(
        theta=jnp.asarray([[0.5, 0.25]]),
        w=jnp.asarray([[0.5, 0.5]]),
        v=jnp.asarray([1.0, 0.5]),
        deviation=REST,
    )
    after, info = learner.update(jax.random.key(0), state, transition(terminated))
    # delta = 4 + 0.5 * V(s') - 5 with V(s') = 2, or 0 where s' is terminal
    assert float(info.delta) == pytest.approx(delta)
    # grad mu (grad mu^T w) = (w.s) s = 1.5 (1, 2)
    np.testing.assert_allclose(after.theta, [[0.65, 0.55]], rtol=1e-6)
    np.testing.assert_allclose(after.w, [[0.5 + 0.4 * delta, 0.5 + 0.8 * delta]], rtol=1e-6)
    np.testing.assert_allclose(after.v, [1.0 + 0.4 * delta, 0.5 + 0.8 * delta], rtol=1e-6)


def test_phi_sees_the_action_as_drawn_or_as_capped():
    """mu = 1, a = 3 and a world that caps at 2: a - mu is 2 as drawn and 1 as capped."""
    state = COPDACQState(
        theta=jnp.asarray([[0.5, 0.25]]),
        w=jnp.asarray([[0.5, 0.5]]),
        v=jnp.zeros(2),
        deviation=REST,
    )
    parts = PARTS | {"bounds": Bounds((-2.0,), (2.0,))}
    for capped, step in ((False, 2.0), (True, 1.0)):
        learner = COPDACQ(**parts, **STEPS, capped=capped)
        after, info = learner.update(jax.random.key(0), state, transition(terminated=True))
        assert float(info.advantage) == pytest.approx(1.5 * step)
        moved = 0.2 * float(info.delta) * step * np.array([[1.0, 2.0]])
        np.testing.assert_allclose(after.w, 0.5 + moved, rtol=1e-6)


def test_the_natural_form_steps_along_w():
    learner = COPDACQ(**PARTS, **STEPS, natural=True)
    state = COPDACQState(
        jnp.zeros((1, 2)), w=jnp.asarray([[3.0, -1.0]]), v=jnp.zeros(2), deviation=REST
    )
    after, _ = learner.update(jax.random.key(0), state, transition())
    np.testing.assert_allclose(after.theta, [[0.3, -0.1]], rtol=1e-6)


@pytest.mark.parametrize("terminated", [False, True])
@pytest.mark.parametrize("correction", ["printed", "full"])
def test_copdac_gq_against_the_explicit_formula(correction, terminated):
    """psi = (phi; s), h = (u; z), x = (w; v): GQ(0) of Maei et al. (2010), written with vectors."""
    learner = COPDACGQ(**PARTS, **STEPS, alpha_u=0.3, correction=correction)
    theta, w = np.array([[0.5, 0.25]]), np.array([0.5, -0.5])
    v, u, z = np.array([1.0, 0.5]), np.array([0.2, 0.1]), np.array([-0.3, 0.4])
    z = z if correction == "full" else 0 * z
    state = COPDACGQState(
        *(jnp.asarray(x, dtype=float) for x in (theta, w[None], v, u[None], z, REST))
    )
    after, _ = learner.update(jax.random.key(0), state, transition(terminated))

    s, next_s = np.array([1.0, 2.0]), np.array([2.0, 0.0])
    psi = np.r_[2 * s, s]
    gamma = 0.0 if terminated else 0.5
    delta = 4 + gamma * v @ next_s - psi @ np.r_[w, v]
    expected = psi @ np.r_[u, z]
    x = np.r_[w, v] + np.r_[0.2, 0.2, 0.4, 0.4] * (
        delta * psi - gamma * expected * np.r_[0, 0, next_s]
    )
    auxiliary = psi if correction == "full" else psi * [1, 1, 0, 0]
    h = np.r_[u, z] + 0.3 * (delta - expected) * auxiliary
    np.testing.assert_allclose(np.r_[after.w[0], after.v], x, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(np.r_[after.u[0], after.z], h, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("correction", ["printed", "full"])
def test_copdac_gq_with_capped_actions(correction):
    """mu = 1, a = 3 and a world that caps at 2: phi = (2 - 1) s, in w's line and in u's."""
    learner = COPDACGQ(
        **PARTS | {"bounds": Bounds((-2.0,), (2.0,))},
        **STEPS,
        alpha_u=0.3,
        capped=True,
        correction=correction,
    )
    w, u = jnp.asarray([[0.5, 0.5]]), jnp.asarray([[0.2, 0.1]])
    state = COPDACGQState(jnp.asarray([[0.5, 0.25]]), w, jnp.zeros(2), u, jnp.zeros(2), REST)
    after, info = learner.update(jax.random.key(0), state, transition(terminated=True))
    # advantage = w . s = 1.5, delta = 4 - 1.5, psi^T h = u . s = 0.4
    assert float(info.advantage) == pytest.approx(1.5)
    s = np.array([[1.0, 2.0]])
    np.testing.assert_allclose(after.w, np.asarray(w) + 0.2 * 2.5 * s, rtol=1e-6)
    np.testing.assert_allclose(after.u, np.asarray(u) + 0.3 * (2.5 - 0.4) * s, rtol=1e-6)
    # the next noise goes on from the action as drawn
    assert float(after.deviation[0]) == 0.0


NUM_RUNS = 32


@pytest.mark.parametrize("correction", ["printed", "full"])
def test_the_critic_of_a_fixed_actor_finds_the_slope_of_q(correction):
    """w s estimates grad_a Q(s, mu(s)), as `detpg verify` checks of COPDAC-Q.

    Episodes are cut after one step: with independent transitions the mean is exact.
    """
    world = LQR(noise=0.3, gamma=0.8)
    rates = {"alpha_theta": 0.0, "alpha_w": 0.02, "alpha_v": 0.02, "alpha_u": 0.02}
    learner = COPDACGQ.create(world.spec, **rates, sigma=0.5, correction=correction)

    @jax.jit
    @jax.vmap
    def run(key):
        _, log = train(learner, OneStep(world), key, 12_000, probe=lambda learner: learner.w)
        return jnp.mean(log.probe[6_000:, 0], axis=0)

    found = np.asarray(run(jax.random.split(jax.random.key(3), NUM_RUNS)), dtype=np.float64)
    gain = jnp.zeros((1, 2))
    slope = jax.vmap(lambda s: jax.grad(world.action_value, argnums=2)(gain, s, gain @ s)[0])
    error = found.std(axis=0, ddof=1) / np.sqrt(NUM_RUNS)
    assert np.all(np.abs(found.mean(axis=0) - slope(jnp.eye(2))) < 4 * error)
    assert np.all(error < 0.05 * np.linalg.norm(slope(jnp.eye(2))))


class Shared:
    """mu_theta = (theta, theta): two components that share their parameter."""

    def init(self, key):
        return jnp.zeros(1)

    def __call__(self, theta, observation):
        return jnp.concatenate([theta, theta])


@pytest.mark.parametrize("learner_class", [COPDACQ, COPDACGQ])
@pytest.mark.parametrize(
    ("sigma", "direction"), [(0.5, 1.0), ((2.0, 0.5), 2 * (4 * -1 + 0.25 * 2) / (4 + 0.25))]
)
def test_unequal_widths_turn_the_direction_where_components_share_parameters(
    learner_class, sigma, direction
):
    """r = -a_1 + 2 a_2, so that grad J = 1; docs/decisions/0018 has the formula."""
    learner = learner_class(
        policy=Shared(),
        state_value=Constant(),
        bounds=Bounds.unbounded(2),
        alpha_theta=0.0,
        alpha_w=0.01,
        alpha_v=0.01,
        sigma=sigma,
    )

    def step(state, key):
        s, rest = jnp.ones(1), jnp.zeros(2)
        a = learner.act(key, state, s)
        reward = -a[0] + 2 * a[1]
        seen = Transition(s, a, reward, s, rest, terminated=jnp.asarray(True))
        return learner.update(key, state, seen)[0], state.w[0]

    @jax.jit
    @jax.vmap
    def run(key):
        keys = jax.random.split(key, 4_000)
        return jnp.mean(jax.lax.scan(step, learner.init(key), keys)[1][2_000:])

    w = np.asarray(run(jax.random.split(jax.random.key(0), NUM_RUNS)), dtype=np.float64)
    error = 2 * w.std(ddof=1) / np.sqrt(NUM_RUNS)
    assert abs(2 * w.mean() - direction) < 4 * error
    assert 4 * error < 0.2


class Constant:
    """V^v(s) = v."""

    def init(self, key):
        return jnp.zeros(())

    def __call__(self, v, observation):
        return v


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"natural": True},
        {"state_value": LinearStateValue(QuadraticFeatures(2))},
        {"state_value": MLPStateValue(2)},
        {"correlation": 0.3},
    ],
    ids=["vanilla", "natural", "linear in features", "mlp", "correlated noise"],
)
def test_copdac_q_improves_the_regulator(options):
    world = LQR(noise=0.3)
    learner = COPDACQ.create(
        world.spec,
        **({"alpha_theta": 1e-3, "alpha_w": 0.02, "alpha_v": 0.01, "sigma": 0.5} | options),
    )
    state, _ = train(learner, world, jax.random.key(1), 60_000)
    before, after = world.objective(jnp.zeros((1, 2))), world.objective(state.learner.theta)
    best = _best(world)
    assert float(after - before) > 0.8 * float(best - before)


def _best(world: LQR) -> jax.Array:
    """J of the best gain, by gradient ascent on the exact objective."""

    def body(_, gain):
        return gain + 0.01 * jax.grad(world.objective)(gain)

    return world.objective(jax.lax.fori_loop(0, 500, body, jnp.zeros((1, 2))))
