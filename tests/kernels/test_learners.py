"""Compiled learners against the algorithms that define them, on the same transitions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks_data import FOLDER
from detpg.algorithms import COPDACGQ, COPDACQ, OffPAC, StochasticAC
from detpg.critics import LinearStateValue
from detpg.environments import MountainCar, PuddleWorld
from detpg.features import TileCoding
from detpg.kernels import LEARNERS, Experience, active_features, replay
from detpg.policies import FeaturePolicy
from detpg.types import Transition

STEPS = 10_000
KEY = jax.random.key(0)


def wander(features: TileCoding, action_size: int):
    """A walk through the observations with ends of both kinds, for either engine."""
    generator = np.random.default_rng(2)
    low, high = np.array(features.low), np.array(features.high)
    places = np.cumsum(generator.normal(0, 0.05, (STEPS + 1, low.size)), axis=0)
    places = np.abs((places + 0.4) % 2 - 1)  # reflected into [0, 1]
    observations = low + (high - low) * places
    action = generator.normal(0, 0.6, (STEPS, action_size))
    reward = -1 - places[1:, 0] + 0.2 * action[:, 0]
    terminated = generator.uniform(size=STEPS) < 0.02
    truncated = generator.uniform(size=STEPS) < 0.02
    now, after = observations[:-1], observations[1:]
    transitions = Transition(
        observation=jnp.asarray(now),
        action=jnp.asarray(action),
        reward=jnp.asarray(reward),
        next_observation=jnp.asarray(after),
        next_action=jnp.asarray(action),
        terminated=jnp.asarray(terminated),
        truncated=jnp.asarray(truncated),
    )
    experience = Experience(
        active_features(features, now),
        action,
        reward,
        active_features(features, after),
        terminated,
        terminated | truncated,
    )
    return transitions, experience


def defined(algorithm, transitions):
    """What the algorithm itself learns."""

    def body(state, transition):
        return algorithm.update(KEY, state, transition)[0], None

    return jax.jit(lambda t: jax.lax.scan(body, algorithm.init(KEY), t)[0])(transitions)


CASES = [
    (COPDACQ, {}, {"alpha_theta": 3e-4, "alpha_w": 0.02, "alpha_v": 0.01}),
    (COPDACQ, {"natural": True}, {"alpha_theta": 1e-6, "alpha_w": 0.02, "alpha_v": 0.01}),
    (COPDACGQ, {}, {"alpha_theta": 3e-4, "alpha_w": 0.02, "alpha_v": 0.01, "alpha_u": 0.01}),
    (
        COPDACGQ,
        {"natural": True, "correction": "printed"},
        {"alpha_theta": 1e-6, "alpha_w": 0.02, "alpha_v": 0.01, "alpha_u": 0.01},
    ),
    (StochasticAC, {}, {"alpha_u": 1e-4, "alpha_y": 1e-5, "alpha_v": 0.01}),
    (
        StochasticAC,
        {"gradient": "scaled"},
        {"alpha_u": 1e-3, "alpha_y": 1e-4, "alpha_v": 0.01, "lambda_": 0.6},
    ),
    (StochasticAC, {"fixed_std": True}, {"alpha_u": 1e-4, "alpha_v": 0.01, "lambda_": 0.3}),
    (OffPAC, {}, {"alpha_u": 1e-4, "alpha_y": 1e-5, "alpha_v": 0.01}),
    (
        OffPAC,
        {},
        {"alpha_u": 1e-5, "alpha_y": 1e-6, "alpha_v": 0.003, "alpha_w": 0.002, "lambda_": 0.4},
    ),
    (OffPAC, {}, {"alpha_u": 1e-5, "alpha_y": 1e-6, "alpha_v": 0.003, "alpha_w": 0.002}),
]
NAMES = {kernel.algorithm: name for name, kernel in LEARNERS.items()}
WIDTHS = {
    COPDACQ: {},
    COPDACGQ: {},
    StochasticAC: {"sigma0": 0.6},
    OffPAC: {"sigma0": 0.5, "sigma": 0.6},
}


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("world", [MountainCar, PuddleWorld])
@pytest.mark.parametrize(("algorithm", "options", "hyper"), CASES)
def test_the_same_transitions_teach_the_same(world, algorithm, options, hyper):
    """10,000 transitions in double precision; 1e-10 relative to the largest number learnt."""
    spec = world().spec
    features, m = TileCoding.for_environment(spec), spec.action_size
    transitions, experience = wander(features, m)
    hyper = {"gamma": 0.97, **hyper, **WIDTHS[algorithm]}
    if algorithm in (COPDACQ, COPDACGQ):
        parts = {"policy": FeaturePolicy(features, m), "state_value": LinearStateValue(features)}
    else:
        parts = {"features": features}
    expected = defined(algorithm.create(spec, **parts, **options, **hyper), transitions)
    expected = named(algorithm, expected)
    # traces that are of no consequence are not kept
    unread = ["e_width"] if options.get("fixed_std") else []
    unread += [] if hyper.get("lambda_") else ["e_mean", "e_width", "e_v"]
    name = NAMES[algorithm]
    found = replay(name, hyper, experience, size=features.size, options=options)
    assert found.keys() == expected.keys() == dict(LEARNERS[name].vectors).keys()
    for vector, values in found.items():
        if vector in unread:
            continue
        size = np.max(np.abs(expected[vector]))
        np.testing.assert_allclose(values, expected[vector], rtol=0, atol=1e-10 * size)
    assert np.max(np.abs(expected["v"])) > 1


def named(algorithm, state):
    """The learnt vectors by the names that the compiled learner uses."""
    if algorithm in (COPDACQ, COPDACGQ):
        names = ("theta", "w", "v") if algorithm is COPDACQ else ("theta", "w", "u", "v", "z")
        return {name: getattr(state, name) for name in names}
    rest = {name: getattr(state, name) for name in ("v", "w", "e_v") if hasattr(state, name)}
    traces = {"e_mean": state.e_u.mean, "e_width": state.e_u.width}
    return {"mean": state.u.mean, "width": state.u.width, **rest, **traces}


@pytest.mark.parametrize(
    ("file", "learner"),
    [
        ("sac_mcar_lambda0", "stochastic-ac"),
        ("sac_pendulum_lambda0", "stochastic-ac"),
        ("offpac_mcar_lambda0_aw0", "offpac"),
    ],
)
@pytest.mark.parametrize("number", [1, 40, 126, 160])
def test_recorded_steps_of_the_authors_library(file, learner, number):
    recorded = np.load(FOLDER / f"{file}.npz")
    assert recorded["terminated"].sum() == (file != "sac_pendulum_lambda0")
    alpha_u = float(recorded["alpha_u"])
    hyper = {"gamma": float(recorded["gamma"]), "alpha_u": alpha_u, "alpha_y": alpha_u}
    hyper |= {"alpha_v": float(recorded["alpha_v"]), "sigma0": float(recorded["sigma0"])}
    if learner == "offpac":
        hyper |= {"sigma": float(recorded["sigma_b"])}
    ended = recorded["terminated"][:number]
    experience = Experience(
        active_in(recorded["x"][:number]),
        recorded["a"][:number],
        recorded["r"][:number],
        active_in(recorded["next_x"][:number]),
        ended,
        ended,
    )
    found = replay(learner, hyper, experience, size=recorded["x"].shape[1])
    for ours, theirs in (("v", "v"), ("mean", "u_mean"), ("width", "u_std")):
        np.testing.assert_allclose(np.ravel(found[ours]), recorded[theirs][number - 1], atol=1e-12)


def active_in(x):
    """Indices of the three ones of each row; where there are none, any."""
    return np.array([np.flatnonzero(row) if row.any() else [0, 0, 0] for row in x])
