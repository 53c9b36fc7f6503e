"""The three tasks of Section 5.2: step by step against RLPark, and by hand."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks_data import columns, vectors
from detpg import greedy_return
from detpg.algorithms import COPDACQ
from detpg.environments import MountainCar, Pendulum, PuddleWorld
from detpg.types import Observation

KEY = jax.random.key(0)
ROUNDING = {"rtol": 1e-12, "atol": 1e-12}


def step(environment, state, action):
    """Next state, reward and whether it is the end, of a step without chance."""
    next_state = environment.transition(KEY, state, action)
    reward = environment.reward(state, action, next_state)
    return next_state, reward, environment.terminated(next_state)


def steps(environment, states, actions):
    return jax.jit(jax.vmap(step, in_axes=(None, 0, 0)))(environment, states, actions)


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize(
    ("name", "world"),
    [
        ("env_mountaincar_fixedstart_gauss", MountainCar),
        ("env_mountaincar_fixedstart_pump", MountainCar),
        ("env_pendulum_fixedstart_gauss", Pendulum),
        ("env_pendulum_fixedstart_pump", Pendulum),
    ],
)
def test_every_recorded_step(name, world):
    environment, table = world(), columns(name)
    found, reward, ended = steps(environment, vectors(table, "s"), vectors(table, "a"))
    np.testing.assert_allclose(found, vectors(table, "ns"), **ROUNDING)
    np.testing.assert_allclose(reward, table["reward"], **ROUNDING)
    np.testing.assert_array_equal(ended, table["env_ending"] == 1)
    start = vectors(table, "s")[0]
    np.testing.assert_allclose(environment.initial(KEY), start, **ROUNDING)


@pytest.mark.usefixtures("x64")
def test_recorded_steps_from_all_over_the_valley():
    """The start was random there; some steps end at the wall, one at the goal."""
    table = columns("env_mountaincar_randomstart")
    found, _, ended = steps(MountainCar(), vectors(table, "s"), vectors(table, "a"))
    np.testing.assert_allclose(found, vectors(table, "ns"), **ROUNDING)
    np.testing.assert_array_equal(ended, table["env_ending"] == 1)
    assert np.min(table["ns0"]) == -1.2
    assert np.max(table["ns0"]) == 0.6


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("name", ["env_puddle_noise0.1_gauss", "env_puddle_noise0.1_goal"])
def test_every_recorded_step_of_the_puddle_world(name):
    table, world = columns(name), PuddleWorld()
    again = table["env_ending"] == 1
    keep = ~again
    states, actions, uniform = (vectors(table, key)[keep] for key in ("s", "a", "u"))
    found = jax.vmap(world.move)(states, actions, uniform)
    np.testing.assert_allclose(found, vectors(table, "ns")[keep], **ROUNDING)
    reward = jax.vmap(world.reward)(states, actions, found)
    np.testing.assert_allclose(reward, table["reward"][keep], **ROUNDING)
    # RLPark delivers the last step twice: the copy is marked, the end is at the step before it.
    arrived = np.append(again[1:], False)[keep]
    np.testing.assert_array_equal(jax.vmap(world.terminated)(found), arrived)
    copies = vectors(table, "ns")[again], vectors(table, "ns")[np.roll(again, -1)]
    np.testing.assert_array_equal(*copies)


@pytest.mark.usefixtures("x64")
def test_the_reward_of_the_puddle_world_on_a_grid():
    table = columns("env_puddle_reward_grid")
    states = np.stack([table["x"], table["y"]], axis=1)
    found = jax.vmap(PuddleWorld().reward)(states, states, states)
    np.testing.assert_allclose(found, table["reward"], **ROUNDING)


def test_the_mountain_car_by_hand():
    car = MountainCar()
    found = car.transition(KEY, jnp.asarray([0.0, 0.01]), jnp.asarray([0.5]))
    # v' = 0.01 + 0.001 * 0.5 - 0.0025 = 0.008
    np.testing.assert_allclose(found, [0.008, 0.008], rtol=1e-6)
    wall = car.transition(KEY, jnp.asarray([-1.19, -0.05]), jnp.asarray([-7.0]))
    np.testing.assert_allclose(wall, [-1.2, 0.0], atol=1e-7)


def test_the_pendulum_by_hand():
    found = Pendulum().transition(KEY, jnp.asarray([0.0, 10.0]), jnp.asarray([3.0]))
    # v' = 10 - 0.1 + 2 (cut off) = 11.9; angle' = 0.119
    np.testing.assert_allclose(found, [0.119, 11.9], rtol=1e-6)
    turned = Pendulum().transition(KEY, jnp.asarray([3.1, 50.0]), jnp.asarray([0.0]))
    v = 50 - 0.5 + 9.8 * math.sin(3.1)
    np.testing.assert_allclose(turned, [3.1 + 0.01 * v - 2 * math.pi, v], rtol=1e-5)
    fast = Pendulum().transition(KEY, jnp.asarray([0.0, 79.0]), jnp.asarray([2.0]))
    np.testing.assert_allclose(fast, [math.pi / 4, 25 * math.pi], rtol=1e-6)


@pytest.mark.usefixtures("x64")
def test_the_pendulum_is_an_euler_step_of_a_tenth_of_a_second():
    states = np.random.default_rng(0).uniform(-2, 2, (50, 2)) * [1.0, 30.0]
    torque = np.linspace(-2, 2, 50)
    w = states[:, 1] / 10
    next_w = w + 0.1 * (9.8 * np.sin(states[:, 0]) + torque - 0.1 * w)
    found, _, _ = steps(Pendulum(), states, torque[:, None])
    expected = np.stack([states[:, 0] + 0.1 * next_w, 10 * next_w], axis=1)
    inside = np.abs(expected[:, 0]) < math.pi
    assert np.sum(inside) > 30
    np.testing.assert_allclose(np.asarray(found)[inside], expected[inside], **ROUNDING)


def test_the_puddle_world_by_hand():
    world = PuddleWorld()
    found = world.move(jnp.asarray([0.5, 0.99]), jnp.asarray([-1.0, 0.05]), jnp.asarray([1.0, 0.5]))
    np.testing.assert_allclose(found, [0.5 - 0.05 + 0.0025, 1.0], rtol=1e-6)
    for state, over in [((0.95, 0.96), True), ((0.94, 0.95), False), ((1.0, 0.89), False)]:
        assert bool(world.terminated(jnp.asarray(state))) == over
    # at the centre of the third puddle the others are more than 4 standard deviations away
    peak = 1 / (2 * math.pi * 0.03 * 0.1)
    centre = jnp.asarray([0.8, 0.9])
    np.testing.assert_allclose(world.reward(centre, centre, centre), -1 - 2 * peak, rtol=1e-4)


@pytest.mark.parametrize(("noise", "size"), [(None, 0.0025), (0.025, 0.025)])
def test_the_noise_of_the_puddle_world_is_uniform(noise, size):
    world = PuddleWorld() if noise is None else PuddleWorld(noise=noise)
    keys, middle = jax.random.split(KEY, 4000), jnp.full(2, 0.5)
    moved = jax.vmap(world.transition, in_axes=(0, None, None))(keys, middle, jnp.zeros(2))
    drawn = np.asarray(moved, dtype=float) - 0.5
    assert np.max(np.abs(drawn)) <= size * (1 + 1e-4)
    # mean 0 and variance size^2 / 3 (its own variance 4 size^4 / 45), at 4.5 standard errors
    error = 4.5 * size / math.sqrt(3 * 8000)
    assert abs(drawn.mean()) < error
    assert abs(np.mean(drawn**2) - size**2 / 3) < 4.5 * size**2 * math.sqrt(4 / 45 / 8000)
    assert abs(np.corrcoef(drawn.T)[0, 1]) < 4.5 / math.sqrt(4000)


@pytest.mark.parametrize("world", [MountainCar, Pendulum])
def test_a_random_start_covers_its_range(world):
    environment = world(random_start=True)
    starts = np.asarray(jax.vmap(environment.initial)(jax.random.split(KEY, 2000)), dtype=float)
    low, high = (np.array(b) for b in (world().spec.observation_low, world().spec.observation_high))
    if world is Pendulum:
        assert np.all(starts[:, 1] == 0)
        starts, low, high = starts[:, :1], low[:1], high[:1]
    places = (starts - low) / (high - low)
    # quarters of the range: 500 each, standard error sqrt(2000 * 3 / 16)
    for k in range(places.shape[1]):
        counts = np.histogram(places[:, k], bins=4, range=(0, 1))[0]
        assert np.all(np.abs(counts - 500) < 4.5 * math.sqrt(2000 * 3 / 16))


@dataclasses.dataclass(frozen=True)
class Pump:
    """Full throttle the way the car is going: pumps energy into it."""

    def init(self, key):
        return jnp.zeros(1)

    def __call__(self, theta, observation: Observation):
        return theta + jnp.where(observation[1:] >= 0, 1.0, -1.0).astype(observation.dtype)


def returns(environment, keys, **parts):
    learner = COPDACQ.create(environment.spec, **parts)
    state = learner.init(KEY)
    play = jax.vmap(lambda key: greedy_return(learner, environment, key, state))
    return np.asarray(jax.jit(play)(keys), dtype=float)


@pytest.mark.usefixtures("x64")
def test_pumping_energy_climbs_the_hill_in_126_steps():
    assert returns(MountainCar(), KEY[None], policy=Pump()).tolist() == [-126.0]


@pytest.mark.usefixtures("x64")
def test_what_zero_action_returns():
    """Where Figure 2 starts: -5000 and -4941 (the pendulum's -4946 is RLPark's)."""
    assert returns(MountainCar(), KEY[None]).tolist() == [-5000.0]
    assert returns(Pendulum(), KEY[None])[0] == pytest.approx(-4946.2, abs=0.05)


def test_what_zero_action_returns_in_the_puddle_world():
    """RLPark: -13973 with standard error 824, and 26072 is the standard deviation of one episode.

    Densities that are not normalised would return -5.2 thousand, noise of 0.025 -29 thousand.
    """
    found = returns(PuddleWorld(), jax.random.split(KEY, 400)).mean()
    assert abs(found + 13973) < 4 * math.hypot(824, 26072 / math.sqrt(400))


@pytest.mark.parametrize(
    ("world", "discount"), [(MountainCar, 0.99), (Pendulum, 0.99), (PuddleWorld, 0.999)]
)
def test_specs(world, discount):
    spec = world().spec
    assert (spec.time_limit, spec.discount) == (5000, discount)
    assert spec.action_low == tuple(-x for x in spec.action_high)
