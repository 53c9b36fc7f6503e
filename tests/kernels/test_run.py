"""The loop: against a plain transcription, and what it promises of runs."""

import dataclasses

import numpy as np
import pytest
from numba import njit

from detpg.environments import PuddleWorld, ScaledActions
from detpg.features import TileCoding, divided
from detpg.kernels import TASKS, active_features, run
from detpg.kernels import random as kernel_random
from detpg.kernels.random import streams
from detpg.kernels.tasks import environment
from detpg.machine import cores

CAR = TileCoding.for_environment(environment("mountain-car", {}).spec)
STEPS = divided(CAR, {"alpha_theta": 0.0066, "alpha_w": 0.1, "alpha_v": 0.1, "sigma": 0.5})


@njit
def normal(stream):
    return kernel_random.normal(stream)


@njit
def uniform(stream):
    return kernel_random.uniform(stream)


class PlainCar:
    """Mountain car and COPDAC-Q in NumPy, on the random numbers of one run."""

    def __init__(self, hyper, words, random_start):
        self.hyper, self.random_start = hyper, random_start
        self.training, self.evaluation = words
        self.theta, self.w, self.v = np.zeros((3, CAR.size))

    def start(self, stream):
        if not self.random_start:
            return np.array([-0.5, 0.0])
        p, v = uniform(stream), uniform(stream)
        return np.array([-1.2 + 1.8 * p, 0.07 * (2 * v - 1)])

    @staticmethod
    def move(state, action):
        p, v = state
        v = np.clip(v + 0.001 * np.clip(action, -1, 1) - 0.0025 * np.cos(3 * p), -0.07, 0.07)
        p = p + v
        return np.array([np.clip(p, -1.2, 0.6), 0.0 if p < -1.2 else v]), p >= 0.6

    @staticmethod
    def tiles(state):
        return active_features(CAR, state[None])[0]

    def play(self):
        """Return of the mean policy."""
        state = self.start(self.evaluation)
        for t in range(5000):
            state, end = self.move(state, self.theta[self.tiles(state)].sum())
            if end:
                return -float(t + 1)
        return -5000.0

    def learn(self):
        """Learns step by step; yields the length of each episode when it is over, else None."""
        h, length, state = self.hyper, 0, self.start(self.training)
        while True:
            x = self.tiles(state)
            noise = h["sigma"] * normal(self.training)
            state, end = self.move(state, self.theta[x].sum() + noise)
            next_x = self.tiles(state)
            bootstrap = 0.0 if end else 0.99 * self.v[next_x].sum()
            slope = self.w[x].sum()
            delta = -1 + bootstrap - (noise * slope + self.v[x].sum())
            self.theta[x] += h["alpha_theta"] * slope
            self.w[x] += h["alpha_w"] * delta * noise
            self.v[x] += h["alpha_v"] * delta
            length += 1
            over = end or length == 5000
            yield length if over else None
            if over:
                state, length = self.start(self.training), 0


@pytest.mark.parametrize("random_start", [False, True])
def test_a_run_is_what_a_plain_loop_computes(random_start):
    """Episodes that the time limit cuts and ones that arrive; evaluations along the way."""
    at = [0, 4000, 8000, 12_000]
    task_options = {"random_start": random_start}
    found = run(
        "mountain-car",
        "copdac-q",
        STEPS,
        runs=[3],
        horizon=12_000,
        evaluate_at=at,
        seed=5,
        task_options=task_options,
    )
    plain = PlainCar(STEPS, streams(5, [0], [3])[0, 0], random_start)
    expected, lengths, learning = [plain.play()], [], plain.learn()
    for _ in at[1:]:
        lengths += [length for _ in range(4000) if (length := next(learning))]
        expected.append(plain.play())
    assert found.returns[0, 0].tolist() == expected
    assert found.steps[0, 0].tolist() == [-x for x in expected]
    assert min(lengths) < 2000
    assert random_start or lengths[0] == 5000


def curves(**changes):
    given = {"runs": range(3), "horizon": 12_000, "evaluate_at": [0, 6000, 12_000], "seed": 1}
    hyper = {**STEPS, "alpha_theta": np.array([1e-3, 2e-3])}
    return run("mountain-car", "copdac-q", hyper, **{**given, **changes})


def same(found, expected):
    for field in dataclasses.fields(found):
        np.testing.assert_array_equal(getattr(found, field.name), getattr(expected, field.name))


@pytest.mark.skipif(cores() < 2, reason="one core")
def test_the_number_of_threads_changes_nothing():
    same(curves(threads=2), curves())


def test_a_run_does_not_depend_on_its_neighbours_or_on_evaluations():
    whole = curves()
    assert len(np.unique(whole.returns[:, :, 1:])) > 4
    part = run(
        "mountain-car",
        "copdac-q",
        {**STEPS, "alpha_theta": 2e-3},
        runs=[2],
        points=[1],
        horizon=12_000,
        evaluate_at=[12_000],
        seed=1,
    )
    assert part.returns.tolist() == whole.returns[1:, 2:, 2:].tolist()
    assert not np.array_equal(curves(seed=2).returns, whole.returns)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "expected", "saturated"),
    [("mountain-car", -5000.0, 0.0), ("pendulum", -4946.2, 0.0)],
)
def test_what_zero_action_returns(task, expected, saturated):
    found = run(task, "copdac-q", {}, runs=[0], horizon=0, evaluate_at=[0])
    assert found.returns[0, 0, 0] == pytest.approx(expected, abs=0.05)
    assert (found.steps.item(), found.saturated.item()) == (5000, saturated)
    assert not found.solved.any()
    assert found.finite.all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "published", "error"), [(0.0025, 13973, 824), (0.025, 28623, 482)]
)
def test_what_zero_action_returns_in_the_puddle_world(noise, published, error):
    """RLPark's means and their standard errors; ours from as many episodes."""
    found = run(
        "puddle-world",
        "copdac-q",
        {},
        runs=range(1000),
        horizon=0,
        evaluate_at=[0],
        task_options={"noise": noise},
    ).returns.ravel()
    own = found.std() / np.sqrt(found.size)
    assert abs(found.mean() + published) < 4 * np.hypot(own, error)


def test_episodes_of_an_evaluation_are_averaged():
    once, often = (
        run("puddle-world", "copdac-q", {}, runs=[0], horizon=0, evaluate_at=[0], episodes=n)
        for n in (1, 20)
    )
    assert often.steps.item() == 5000
    assert often.returns.item() != once.returns.item()
    assert -60_000 < often.returns.item() < -5000


def test_scaled_actions_are_those_of_the_wrapper():
    """In the pendulum's own units a width of 1 is half of full torque."""
    given = {"runs": range(2), "horizon": 2000, "evaluate_at": [2000]}
    # scaling actions by 2 scales theta by 2 and the slope w by 1/2
    scaled = run("pendulum", "copdac-q", {**STEPS, "sigma": 0.5}, **given)
    own = {"alpha_theta": 4 * STEPS["alpha_theta"], "alpha_w": STEPS["alpha_w"] / 4, "sigma": 1.0}
    plain = run("pendulum", "copdac-q", {**STEPS, **own}, scaled=False, **given)
    np.testing.assert_allclose(plain.returns, scaled.returns, rtol=1e-9)
    assert ScaledActions(PuddleWorld()).spec.action_high == (1.0, 1.0)


def test_an_actor_beyond_the_range_is_seen():
    found = run(
        "pendulum",
        "copdac-q",
        {**STEPS, "alpha_theta": 1.0, "alpha_v": 0.01},
        runs=[0],
        horizon=5000,
        evaluate_at=[0, 5000],
    )
    assert found.saturated[0, 0, 0] == 0
    assert found.saturated[0, 0, 1] > 0.5


@pytest.mark.parametrize("task", TASKS)
def test_a_run_that_diverges_is_a_value(task):
    found = run(
        task,
        "copdac-q",
        {**STEPS, "alpha_v": np.array([10.0, 0.001])},
        runs=range(2),
        horizon=5000,
        evaluate_at=[0, 1, 4000, 5000],
    )
    assert found.finite[:, :, :2].all()
    assert not found.finite[0, :, 2:].any()
    assert np.isnan(found.returns[0, :, 2:]).all()
    assert not found.solved[0, :, 2:].any()
    assert np.isfinite(found.returns[1]).all()


@pytest.mark.slow
def test_single_precision_learns_too():
    found = run(
        "mountain-car",
        "copdac-q",
        STEPS,
        runs=range(6),
        horizon=50_000,
        evaluate_at=[50_000],
        dtype=np.float32,
    )
    assert np.median(found.returns) > -300
