"""stochastic-ac and offpac: recorded steps replayed, traces against plain arithmetic, learning."""

import dataclasses
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.algorithms import OffPAC, StochasticAC
from detpg.environments import LQR
from detpg.training import train
from detpg.types import Transition

RECORDED = Path(__file__).parents[1] / "fixtures" / "benchmarks"


@dataclasses.dataclass(frozen=True)
class AsObserved:
    """x(s) = s."""

    size: int

    def __call__(self, observation):
        return observation


def transitions(recorded) -> Transition:
    """All recorded steps, stacked; a' is not read by these learners."""
    x, next_x = (jnp.asarray(recorded[name], dtype=float) for name in ("x", "next_x"))
    return Transition(
        observation=x,
        action=jnp.asarray(recorded["a"]),
        reward=jnp.asarray(recorded["r"]),
        next_observation=next_x,
        next_action=jnp.asarray(recorded["a"]),
        terminated=jnp.asarray(recorded["terminated"]),
        truncated=jnp.zeros(len(x), dtype=bool),
    )


def replay(learner, experience: Transition):
    """The State and Info after each transition."""
    key = jax.random.key(0)

    def body(state, transition):
        state, info = learner.update(key, state, transition)
        return state, (state, info)

    return jax.lax.scan(body, learner.init(key), experience)[1]


def assert_equal(found, expected) -> None:
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize(
    ("name", "learner_class"),
    [
        ("sac_mcar_lambda0", StochasticAC),
        ("sac_pendulum_lambda0", StochasticAC),
        ("offpac_mcar_lambda0_aw0", OffPAC),
    ],
)
def test_recorded_steps_are_replayed(name, learner_class):
    recorded = np.load(RECORDED / f"{name}.npz")
    widths = {"sigma": recorded["sigma_b"]} if learner_class is OffPAC else {}
    learner = learner_class(
        features=AsObserved(19),
        action_size=1,
        gamma=recorded["gamma"],
        alpha_u=recorded["alpha_u"],
        alpha_y=recorded["alpha_u"],
        alpha_v=recorded["alpha_v"],
        sigma0=recorded["sigma0"],
        **widths,
    )
    states, info = replay(learner, transitions(recorded))
    assert_equal(info.delta, recorded["delta"])
    assert_equal(states.v, recorded["v"])
    assert_equal(states.u.mean[:, 0], recorded["u_mean"])
    assert_equal(states.u.width[:, 0], recorded["u_std"])
    if learner_class is OffPAC:
        assert_equal(info.rho, recorded["pi"] / recorded["b"])
        assert_equal(states.w, recorded["w"])


NUM_STEPS, SIZE, ACTIONS = 12, 3, 2


def experience() -> Transition:
    """Random transitions; an episode is cut after the 5th and terminates at the 9th."""
    draw = np.random.default_rng(3).normal
    index = np.arange(NUM_STEPS)
    return Transition(
        observation=jnp.asarray(draw(size=(NUM_STEPS, SIZE))),
        action=jnp.asarray(draw(size=(NUM_STEPS, ACTIONS))),
        reward=jnp.asarray(draw(size=NUM_STEPS)),
        next_observation=jnp.asarray(draw(size=(NUM_STEPS, SIZE))),
        next_action=jnp.zeros((NUM_STEPS, ACTIONS)),
        terminated=jnp.asarray(index == 8),
        truncated=jnp.asarray(index == 4),
    )


STEPS = {"gamma": 0.9, "lambda_": 0.7, "alpha_u": 0.02, "alpha_y": 0.01, "alpha_v": 0.05}


def arrays(data: Transition):
    """One step after the other, as plain arrays."""
    for t in range(NUM_STEPS):
        row = jax.tree.map(lambda x, t=t: np.asarray(x[t]), data)
        gamma = 0.0 if row.terminated else STEPS["gamma"]
        ended = bool(row.terminated or row.truncated)
        yield row.observation, row.action, row.reward, row.next_observation, gamma, ended


def scores(um, us, x, a, sigma0, scaled=False):
    """The gradients of the log density of the mean's and the width's weights, and the density."""
    mu, sigma = um @ x, sigma0 * np.exp(us @ x) + 1e-7
    unit = sigma**2 if scaled else 1.0
    of_mean, of_width = (a - mu) / sigma**2 * unit, ((a - mu) ** 2 / sigma**2 - 1) * unit
    density = np.prod(np.exp(-0.5 * ((a - mu) / sigma) ** 2) / (np.sqrt(2 * np.pi) * sigma))
    return np.outer(of_mean, x), np.outer(of_width, x), mu, density


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("gradient", ["plain", "scaled"])
@pytest.mark.parametrize("fixed_std", [False, True])
def test_stochastic_ac_with_traces(gradient, fixed_std):
    data, kept = experience(), STEPS["gamma"] * STEPS["lambda_"]
    options = {"gradient": gradient, "fixed_std": fixed_std, "sigma0": 0.8}
    learner = StochasticAC(features=AsObserved(SIZE), action_size=ACTIONS, **options, **STEPS)
    states, _ = replay(learner, data)

    um, us, v = np.zeros((ACTIONS, SIZE)), np.zeros((ACTIONS, SIZE)), np.zeros(SIZE)
    em, es, ev = np.zeros_like(um), np.zeros_like(us), np.zeros_like(v)
    for t, (x, a, r, next_x, gamma, ended) in enumerate(arrays(data)):
        gm, gs, _, _ = scores(um, us, x, a, 0.8, gradient == "scaled")
        delta = r + gamma * v @ next_x - v @ x
        ev, em, es = kept * ev + x, kept * em + gm, kept * es + gs
        v, um = v + 0.05 * delta * ev, um + 0.02 * delta * em
        us = us if fixed_std else us + 0.01 * delta * es
        if ended:
            ev, em, es = 0 * ev, 0 * em, 0 * es
        assert_equal(states.v[t], v)
        assert_equal(states.u.mean[t], um)
        assert_equal(states.u.width[t], us)


@pytest.mark.usefixtures("x64")
def test_offpac_with_traces_and_gradient_correction():
    data, lam, fixed_gamma = experience(), STEPS["lambda_"], STEPS["gamma"]
    widths = {"sigma0": 0.8, "sigma": 1.1, "alpha_w": 0.03}
    learner = OffPAC(features=AsObserved(SIZE), action_size=ACTIONS, **widths, **STEPS)
    states, _ = replay(learner, data)

    um, us, v = np.zeros((ACTIONS, SIZE)), np.zeros((ACTIONS, SIZE)), np.zeros(SIZE)
    w, em, es, ev = np.zeros(SIZE), np.zeros_like(um), np.zeros_like(us), np.zeros(SIZE)
    for t, (x, a, r, next_x, gamma, ended) in enumerate(arrays(data)):
        gm, gs, mu, density = scores(um, us, x, a, 0.8)
        behaviour = np.prod(np.exp(-0.5 * ((a - mu) / 1.1) ** 2) / (np.sqrt(2 * np.pi) * 1.1))
        rho = density / behaviour
        delta = r + gamma * v @ next_x - v @ x
        ev = rho * (x + fixed_gamma * lam * ev)
        v = v + 0.05 * (delta * ev - gamma * (1 - lam) * (w @ ev) * next_x)
        w = w + 0.03 * (delta * ev - (w @ x) * x)
        em, es = rho * (gm + lam * em), rho * (gs + lam * es)
        um, us = um + 0.02 * delta * em, us + 0.01 * delta * es
        if ended:
            ev, em, es = 0 * ev, 0 * em, 0 * es
        assert_equal(states.v[t], v)
        assert_equal(states.w[t], w)
        assert_equal(states.u.mean[t], um)
        assert_equal(states.u.width[t], us)


@pytest.mark.parametrize(
    ("learner_class", "options"),
    [
        (StochasticAC, {"fixed_std": True}),
        (StochasticAC, {"lambda_": 0.5, "gradient": "scaled", "alpha_y": 1e-5}),
        (OffPAC, {"sigma": 0.5, "alpha_y": 1e-5}),
    ],
)
def test_the_regulator_improves(learner_class, options):
    """J of the learnt linear part of the mean, against the best gain's."""
    world = LQR(noise=0.3)
    rates = {"alpha_u": 2e-4, "alpha_v": 0.01, "sigma0": 0.5} | options
    learner = learner_class.create(world.spec, **rates)
    state, _ = train(learner, world, jax.random.key(1), 60_000)
    # the features are 1, s1, s2, their squares and product, in the order of numpy.triu_indices
    gain = state.learner.u.mean[:, 1:3]
    before, after = world.objective(jnp.zeros((1, 2))), world.objective(gain)
    best = jax.lax.fori_loop(
        0, 500, lambda _, k: k + 0.01 * jax.grad(world.objective)(k), jnp.zeros((1, 2))
    )
    assert float(after - before) > 0.6 * float(world.objective(best) - before)


@pytest.mark.parametrize("learner_class", [StochasticAC, OffPAC])
def test_the_default_step_sizes_keep_eight_of_eight_runs_finite(learner_class):
    world = LQR()
    learner = learner_class.create(world.spec)

    @jax.jit
    @jax.vmap
    def run(key):
        state, log = train(learner, world, key, 5_000)
        return log.info.delta, world.objective(state.learner.u.mean[:, 1:3])

    delta, found = run(jax.random.split(jax.random.key(0), 8))
    assert np.all(np.isfinite(delta))
    assert np.all(np.asarray(found) > float(world.objective(jnp.zeros((1, 2)))))


@pytest.mark.usefixtures("unchecked")
def test_features_of_another_size_are_refused():
    with pytest.raises(ValueError, match=r"have shape \(2,\), but their size is said to be 3"):
        StochasticAC.create(LQR().spec, features=AsObserved(3))
