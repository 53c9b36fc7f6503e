"""Learning from logged transitions: what each step sees, where it stops, and where it arrives."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.algorithms import ALGORITHMS, OPDAC
from detpg.environments import LQR, QuadraticBandit
from detpg.policies import ConstantPolicy, FunctionPolicy
from detpg.replaying import Logged, learn_from
from detpg.types import Bounds
from detpg.wrappers import Metered, Normalised
from logs import POOR, SEEDS, learnt, lqr_log, nearness, opdac_gains, riccati
from toys import Recorder

KEY = jax.random.key(0)
ROWS = 7


def gain(theta, observation):
    return theta @ observation


def logged(**columns):
    """Seven transitions, each with its number in it."""
    number, none = np.arange(ROWS, dtype=np.float32), np.zeros(ROWS, bool)
    given = {
        "observation": number[:, None],
        "action": number[:, None] / ROWS,
        "reward": 10 * number,
        "next_observation": 100 + number[:, None],
        "terminated": none,
        "truncated": none,
        "episode": np.zeros(ROWS, np.int32),
    }
    return Logged(**(given | columns), bounds=Bounds((-2.0,), (2.0,)))


@functools.partial(jax.jit, static_argnames="steps")
def run(algorithm, data, key, steps, start=None):
    return learn_from(algorithm, data, key, steps, start)


def seen(key, steps, start=None):
    state, log = run(Recorder(), logged(), key, steps, start)
    return state, jax.tree.map(np.asarray, log.info["transition"])


def test_each_epoch_goes_through_every_row_once_in_an_order_of_its_own():
    _, transitions = seen(KEY, 5 * ROWS)
    epochs = transitions.observation[:, 0].reshape(5, ROWS).astype(int).tolist()
    assert [sorted(epoch) for epoch in epochs] == [list(range(ROWS))] * 5
    # two of 5040 orders are equal once in 500 runs of this test with another key
    assert len({tuple(epoch) for epoch in epochs}) == 5
    assert epochs[0] != seen(jax.random.key(1), ROWS)[1].observation[:, 0].tolist()


def test_a_step_sees_one_row_and_what_the_learner_itself_would_do_next():
    _, transitions = seen(KEY, 2 * ROWS)
    number = transitions.observation[:, 0]
    np.testing.assert_array_equal(transitions.action[:, 0], number / np.float32(ROWS))
    np.testing.assert_array_equal(transitions.reward, 10 * number)
    np.testing.assert_array_equal(transitions.next_observation[:, 0], 100 + number)
    # Recorder's greedy action is its count, t before update t; its noise would add a fraction
    np.testing.assert_array_equal(transitions.next_action[:, 0], np.arange(2 * ROWS))
    assert transitions.truncated.all()
    assert not transitions.terminated.any()


@pytest.mark.parametrize("cut", [1, ROWS - 1, ROWS, ROWS + 1, 3 * ROWS - 1])
def test_a_resumed_run_is_the_whole_run_to_the_bit(cut):
    whole, all_rows = seen(KEY, 3 * ROWS)
    half, before = seen(KEY, cut)
    resumed, after = seen(KEY, 3 * ROWS - cut, half)
    assert int(half.step) == cut
    assert jax.tree.all(jax.tree.map(jnp.array_equal, resumed, whole))
    joined = jax.tree.map(lambda a, b: np.concatenate([a, b]), before, after)
    assert jax.tree.all(jax.tree.map(np.array_equal, joined, all_rows))


def test_seeds_side_by_side_are_seeds_alone():
    keys = jax.random.split(KEY, 3)
    together = jax.vmap(lambda key: run(Recorder(), logged(), key, 10)[1].info["key"])(keys)
    alone = [run(Recorder(), logged(), key, 10)[1].info["key"] for key in keys]
    np.testing.assert_array_equal(together, alone)
    assert len(np.unique(np.asarray(together).reshape(30, -1), axis=0)) == 30


@pytest.mark.parametrize(("terminated", "value"), [(True, 1.0), (False, 2.0)])
def test_only_a_terminal_state_stops_bootstrapping(terminated, value):
    """One state, reward 1, gamma 1/2: Q is 1 where it ends, 1 / (1 - gamma) where it was cut."""
    one, flags = np.ones((ROWS, 1), np.float32), np.full(ROWS, terminated)
    columns = {"observation": one, "action": 0 * one, "next_observation": one}
    data = logged(**columns, reward=one[:, 0], terminated=flags, truncated=np.ones(ROWS, bool))
    learner = OPDAC.create(data.spec(0.5), policy=ConstantPolicy(1), alpha_theta=0.0, alpha_w=0.1)
    state, _ = run(learner, data, KEY, 1000)
    found = learner.action_value(state.learner.w, jnp.ones(1), jnp.zeros(1))
    # a step of 0.1 on three features that are 1 leaves (1 - 0.3 / value)^1000 of the error
    np.testing.assert_allclose(found, value, rtol=1e-5)


def test_nothing_is_carried_from_one_row_to_the_next():
    learner = OPDAC.create(logged().spec(0.9), correlation=0.9)
    state, _ = run(learner, logged(), KEY, 3)
    assert state.learner.deviation.tolist() == [0.0]


def test_the_spec_is_in_units_of_the_box():
    spec = logged().spec(0.9)
    assert (spec.bounds, spec.discount) == (Bounds((-1.0,), (1.0,)), 0.9)
    assert (spec.observation_size, spec.action_size) == (1, 1)


def test_the_gain_of_the_riccati_equation_is_found_in_what_a_poor_gain_did():
    """Uniform noise around a gain on the wrong side: no density is known, no noise is added."""
    found, best, error = opdac_gains()
    away = np.abs(found.mean(axis=0) - best)
    assert np.all(away < 4.5 * error / np.sqrt(SEEDS)), (away, error)
    # and the interval is narrow: a tenth of the way from the behaviour's gain
    assert 4.5 * np.max(error) / np.sqrt(SEEDS) < 0.1 * nearness(), (error, nearness())


@pytest.mark.parametrize("name", ["copdac-q", "copdac-gq"])
def test_compatible_critics_improve_the_behaviour_and_then_go_too_far(name):
    """Their slope is that at the behaviour's actions, which do not follow mu_theta."""
    best, world = riccati()
    policy = FunctionPolicy(gain, np.asarray(POOR))
    rates = {"alpha_w": 0.03, "alpha_v": 0.01, "alpha_theta": 0.001}
    learner = ALGORITHMS[name].create(world.spec, policy=policy, **rates)
    with pytest.warns(UserWarning, match=r"^COPDACG?Q reads its slope at the behaviour's .*\.$"):
        early, late = learnt(learner, 2_500, 7_500)
    objective = jax.jit(jax.vmap(world.objective))
    poor, early_return, late_return = map(objective, (jnp.asarray([POOR]), early, late))
    assert np.all(early_return > poor)
    assert np.all(late_return < early_return)
    # beyond the best gain, farther than it was to begin with
    assert np.all(np.linalg.norm(late[:, 0] - best, axis=-1) > nearness())


def test_wrapped_learners_learn_the_same():
    data = lqr_log(jax.random.key(3), 500)
    learner = OPDAC.create(data.spec(0.9))
    bare, _ = run(learner, data, KEY, 200)
    metered, _ = run(Metered(learner, data.bounds), data, KEY, 200)
    same = jnp.array_equal(metered.learner.learner.theta, bare.learner.theta)
    assert same
    assert float(metered.learner.meter.episodes) == 200
    normalised, _ = run(Normalised(learner, 2), data, KEY, 200)
    assert bool(jnp.all(jnp.isfinite(normalised.learner.learner.theta)))


def test_data_in_single_precision_teach_a_learner_in_double(x64):
    state, _ = run(OPDAC.create(logged().spec(0.9)), logged(), KEY, 2)
    assert state.learner.w.dtype == np.float64


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("dac", "its Sarsa critic learns"),
        ("stochastic-ac", "it is on-policy"),
        ("offpac", "it divides by the density"),
        ("bandit-copdac", "it takes batches of"),
        ("bandit-stochastic-ac", "it takes batches of"),
    ],
)
def test_learners_that_would_be_misled_are_refused(name, why):
    world = QuadraticBandit(1) if name.startswith("bandit") else LQR()
    learner = ALGORITHMS[name].create(world.spec)
    learners = [learner]
    if learner.experience.kind == "each":
        learners.append(Metered(Normalised(learner, 1), world.spec.bounds))
    for one in learners:
        said = f"{type(learner).__name__} cannot learn from logged data, since {why}"
        with pytest.raises(ValueError, match=rf"^{said}.*: take opdac\.$"):
            learn_from(one, logged(), KEY, 1)


def test_no_step_is_refused():
    with pytest.raises(ValueError, match=r"^steps = 0 is not usable: give 1 or more\.$"):
        learn_from(Recorder(), logged(), KEY, 0)


def test_new_numbers_and_data_of_one_size_trace_once():
    count = 0

    def counted(learner, data, key):
        nonlocal count
        count += 1
        return learn_from(learner, data, key, 3)[0]

    compiled = jax.jit(counted)
    for gamma in (0.5, 0.9):
        learner = OPDAC.create(logged().spec(gamma))
        compiled(learner, logged(), jax.random.key(1))
        compiled(dataclasses.replace(learner, alpha_w=0.1), logged(reward=np.ones(7, "f")), KEY)
    assert count == 1
