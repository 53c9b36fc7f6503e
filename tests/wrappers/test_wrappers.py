"""Normalisers, meters, several worlds: against NumPy and against the learner left alone."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.algorithms import ALGORITHMS
from detpg.environments import LQR, QuadraticBandit, ScaledActions
from detpg.testing import check_algorithm
from detpg.training import begin, train
from detpg.types import Bounds, Number, Transition, strong
from detpg.wrappers import (
    Controller,
    Metered,
    Normalised,
    of_each_world,
    several_worlds,
)
from toys import Chain

KEY = jax.random.key(3)
INCREMENTAL = [name for name in ALGORITHMS if not name.startswith("bandit")]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["copdac-q", "stochastic-ac"])
@pytest.mark.parametrize("wrapper", [Normalised, Metered])
def test_a_wrapped_learner_is_a_learner(name, wrapper):
    spec = LQR().spec
    check_algorithm(wrapper.create(spec, algorithm=ALGORITHMS[name].create(spec)), LQR())


def test_nothing_counts_before_there_are_two_values():
    learner, state = walked([7.0], jnp.asarray([[3.0, 4.0], [9.0, 9.0]]), [False])
    np.testing.assert_allclose(learner.seen(state, jnp.asarray([5.0, 6.0])), 0.0, atol=1e-17)


def walked(rewards, observations, ended):
    """A normalised learner after a few transitions, and what the learner inside was given."""
    spec = Chain().spec
    inner = ALGORITHMS["opdac"].create(spec, alpha_theta=0.0)
    learner = Normalised.create(spec, algorithm=inner, rewards=True, gamma=0.9)
    state, update = learner.init(KEY), jax.jit(lambda *given: learner.update(*given))
    for i, reward in enumerate(rewards):
        transition = Transition(
            observations[i],
            jnp.zeros(1),
            jnp.asarray(reward),
            observations[i + 1],
            jnp.zeros(1),
            terminated=jnp.asarray(ended[i]),
        )
        state, _ = update(KEY, state, transition)
    return learner, state


def test_what_it_has_seen_is_counted_after_it_was_learnt_from(x64):
    observations = jnp.asarray(np.random.default_rng(1).normal(2, 4, (6, 2)))
    rewards, ended = [1.0, 2.0, -1.0, 4.0, 3.0], [False, False, True, False, False]
    learner, state = walked(rewards, observations, ended)
    seen = np.asarray(observations[:5])
    np.testing.assert_allclose(state.observations.mean, seen.mean(axis=0))
    returns, running = [], 0.0
    for reward, over in zip(rewards, ended):
        running = 0.9 * running + reward
        returns.append(running)
        running = 0.0 if over else running
    np.testing.assert_allclose(state.returns.deviation, np.std(returns), rtol=1e-7)
    np.testing.assert_allclose(state.discounted, 0.9 * 4 + 3)
    expected = (np.asarray(observations[5]) - seen.mean(axis=0)) / seen.std(axis=0)
    np.testing.assert_allclose(learner.seen(state, observations[5]), expected, rtol=1e-6)


def test_what_lies_far_out_is_cut_off():
    observations = jnp.asarray(np.random.default_rng(1).normal(0, 1, (6, 2)), dtype=float)
    learner, state = walked([0.0] * 5, observations, [False] * 5)
    assert learner.seen(state, jnp.asarray([1e6, -1e6])).tolist() == [10.0, -10.0]


class InUnits(LQR):
    """The same world, told in other units of observations and rewards."""

    unit: Number

    def __init__(self, unit=1.0):
        super().__init__()
        self.unit = strong(unit)

    def observe(self, state):
        return self.unit * super().observe(state)

    def reward(self, state, action, next_state):
        return self.unit * super().reward(state, action, next_state)


def test_the_same_is_learnt_in_other_units():
    inner = ALGORITHMS["opdac"].create(LQR().spec, alpha_theta=0.01, alpha_w=0.01)
    learner = Normalised.create(LQR().spec, algorithm=inner, rewards=True)
    learnt = jax.jit(lambda world: train(learner, world, KEY, 200)[0].learner.learner)
    wanted = learnt(InUnits())
    assert np.abs(wanted.theta).max() > 1e-3
    for unit in (1e-12, 1e-7, 1e-3, 1e3, 1e7, 1e12):
        found = learnt(InUnits(unit=unit))
        np.testing.assert_allclose(found.theta, wanted.theta, rtol=1e-3, atol=1e-6)


def test_batch_learners_are_refused():
    spec = QuadraticBandit(m=2, key=KEY).spec
    inner = ALGORITHMS["bandit-copdac"].create(spec)
    with pytest.raises(ValueError, match=r"^The learner takes 4 transitions per update, .*\.$"):
        Normalised.create(spec, algorithm=inner)


@pytest.mark.parametrize("name", INCREMENTAL)
def test_a_metered_learner_learns_what_it_learns_without(name):
    world = ScaledActions(LQR())
    plain = ALGORITHMS[name].create(world.spec)
    metered = Metered.create(world.spec, algorithm=plain)
    alone = jax.jit(lambda key: train(plain, world, key, 30))(KEY)[0].learner
    watched = jax.jit(lambda key: train(metered, world, key, 30))(KEY)[0].learner
    jax.tree.map(
        lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-7), watched.learner, alone
    )
    assert float(watched.meter.steps) == 30


def metered_steps(reward, observation, steps=4, ended_at=2, action=0.5):
    spec = Chain().spec
    learner = Metered.create(spec, algorithm=ALGORITHMS["opdac"].create(spec))
    state, update = learner.init(KEY), jax.jit(lambda *given: learner.update(*given))
    for i in range(steps):
        transition = Transition(
            jnp.asarray(observation, dtype=float),
            jnp.asarray([action], dtype=float),
            jnp.asarray(reward if i == 1 else 1.0, dtype=float),
            jnp.asarray(observation, dtype=float),
            jnp.zeros(1),
            terminated=jnp.asarray(i == ended_at),
        )
        state, _ = update(KEY, state, transition)
    return state.meter


def test_the_meter_counts_episodes():
    meter = metered_steps(reward=5.0, observation=[0.0, 0.0])
    assert (float(meter.episodes), float(meter.returns), float(meter.lengths)) == (1, 7, 3)
    assert (float(meter.episode_return), float(meter.episode_length)) == (1, 1)
    np.testing.assert_allclose(meter.deviations / meter.steps, 0.25)  # mu = 0, a = 0.5
    read = meter.read()
    assert (float(read.steps), float(read.episodes)) == (0, 0)
    assert (float(read.episode_return), int(read.age)) == (1, 4)


@pytest.mark.parametrize(
    ("given", "quantity"),
    [
        ({"observation": [np.nan, 0.0]}, 1),
        ({"action": np.inf}, 2),
        ({"reward": np.nan}, 3),
    ],
)
def test_the_first_quantity_that_is_not_finite_is_named(given, quantity):
    meter = metered_steps(**{"reward": 1.0, "observation": [0.0, 0.0]} | given)
    assert int(meter.fault) == quantity
    assert int(meter.fault_step) == (1 if "reward" in given else 0)


def test_saturation_is_the_share_of_mean_actions_on_a_bound():
    spec = Chain().spec
    learner = Metered.create(spec, algorithm=ALGORITHMS["opdac"].create(spec))
    state = learner.init(KEY)
    for theta, share in ((0.0, 0.0), (50.0, 1.0)):
        held = dataclasses.replace(state.learner, theta=jnp.full((1, 2), theta))
        one = jnp.ones(2)
        transition = Transition(
            one, jnp.zeros(1), jnp.zeros(()), one, jnp.zeros(1), terminated=jnp.asarray(False)
        )
        after, _ = learner.update(KEY, dataclasses.replace(state, learner=held), transition)
        assert float(after.meter.saturated) == share


@pytest.mark.parametrize("name", INCREMENTAL)
def test_traces_and_deviations_belong_to_a_world(name):
    spec = LQR().spec
    learner = Normalised.create(spec, algorithm=ALGORITHMS[name].create(spec))
    state = learner.init(KEY)
    mask = of_each_world(state)
    marked = {jax.tree_util.keystr(path) for path, each in jax.tree.leaves_with_path(mask) if each}
    names = {"deviation", "noise"} & set(state.learner.__dataclass_fields__)
    names |= {n for n in state.learner.__dataclass_fields__ if n.startswith("e_")}
    assert {path.split(".")[2].split("[")[0] for path in marked if "learner" in path} == names
    assert ".discounted" in marked
    many = several_worlds(state, 3)
    for leaf, wide, each in zip(*map(jax.tree.leaves, (state, many, mask)), strict=True):
        assert wide.shape == ((3, *leaf.shape) if each else leaf.shape)


def test_a_controller_speaks_the_units_of_the_world():
    spec = ScaledActions(LQR()).spec
    inner = ALGORITHMS["opdac"].create(spec)
    bounds = Bounds((-1.0, 0.0)[:1], (5.0,))
    state = begin(inner, LQR(), KEY).learner
    state = dataclasses.replace(state, theta=jnp.zeros_like(state.theta))
    at = jnp.ones(spec.observation_size)
    assert Controller(inner, state, bounds)(at).tolist() == [2.0]
    pushed = dataclasses.replace(state, theta=jnp.full_like(state.theta, 99.0))
    assert Controller(inner, pushed, bounds)(at).tolist() == [5.0]
