"""Learners in worlds of the host: against a loop written by hand."""

import dataclasses
import functools
import operator
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from slope import Endless, Slope

from detpg.algorithms import ALGORITHMS
from detpg.integrations.gymnasium.worlds import open_worlds
from detpg.training import StepKeys
from detpg.types import Bounds, EnvironmentSpec, Transition
from detpg.workbench import Config, judged
from detpg.workbench.engines import engine_of
from detpg.workbench.hosted import Hosted

SEED, STEPS, BOX = 5, 30, Bounds((-1.0,), (3.0,))
SPEC = EnvironmentSpec("Slope", 2, 1, (-1.0,), (1.0,), 4, 0.9)
# Options, and what belongs to the episode. The noise is wide enough to leave the box.
LEARNERS = {
    "copdac-q": ({"sigma": 0.8, "correlation": 0.7, "alpha_theta": 0.01}, ["deviation"]),
    "stochastic-ac": ({"lambda_": 0.9, "alpha_u": 0.01, "sigma0": 0.8}, ["e_u", "e_v"]),
}


def learner_of(name):
    return ALGORITHMS[name].create(SPEC, **LEARNERS[name][0])


def config(**changes):
    return Config("copdac-q", "Slope", **{"seed": SEED, "log_every": 10} | changes)


def opened(made=None, make=Slope):
    """Worlds for an engine; the environments are kept in a list."""

    def build(num):
        worlds = open_worlds(make, num)
        if made is not None:
            made.extend(getattr(worlds, "envs", ()))
        return worlds

    return build


def engine_with(learner, made=None, make=Slope, **changes):
    engine = Hosted(config(**changes), opened(made, make))
    engine.use(learner)
    return engine


def legal(action):
    """From units of the box to those of the world, in NumPy."""
    return np.clip(1.0 + 2.0 * np.asarray(action, np.float64), -1.0, 3.0)


def by_hand(name, num):
    """What a learner becomes in `num` worlds, one after another in each step."""
    learner, own = learner_of(name), LEARNERS[name][1]
    act, update = (jax.jit(functools.partial(step)) for step in (learner.act, learner.update))
    key = jax.random.fold_in(jax.random.fold_in(jax.random.key(SEED), 0), 0)
    shared = learner.init(jax.random.split(key)[1])
    kept = [{field: getattr(shared, field) for field in own} for _ in range(num)]
    seeds = [
        int(np.random.SeedSequence([SEED, 0, 0, i]).generate_state(1)[0]) % (2**31 - 2**20)
        for i in range(num)
    ]
    worlds = [Slope() for _ in range(num)]

    def streams(step):
        keys = jax.random.split(jax.random.fold_in(key, step), (num, 4))
        return [StepKeys(*key) for key in keys]

    seen = [world.reset(seed=int(seed))[0] for world, seed in zip(worlds, seeds)]
    actions = [act(stream.environment, shared, x) for stream, x in zip(streams(0), seen)]
    for call in range(STEPS // num):
        streamed = streams(call * num)
        for i, world in enumerate(worlds):
            last, reward, terminated, truncated, _ = world.step(legal(actions[i]).astype("f"))
            state = dataclasses.replace(shared, **kept[i])
            transition = Transition(
                jnp.asarray(seen[i]),
                actions[i],
                jnp.asarray(reward, dtype=float),
                next_observation=jnp.asarray(last),
                next_action=act(streamed[i].behaviour, state, last),
                terminated=jnp.asarray(terminated),
                truncated=jnp.asarray(truncated),
            )
            shared, _ = update(streamed[i].update, state, transition)
            kept[i] = {field: getattr(shared, field) for field in own}
            seen[i] = world.reset()[0] if terminated or truncated else last
        for i in range(num):
            state = dataclasses.replace(shared, **kept[i])
            actions[i] = act(streamed[i].behaviour, state, seen[i])
    return shared, kept, worlds


def alike(one, other):
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-6), one, other)


def same(one, other):
    jax.tree.map(np.testing.assert_array_equal, one, other)


@pytest.mark.parametrize(("name", "num"), [("copdac-q", 1), ("copdac-q", 2), ("stochastic-ac", 2)])
def test_it_learns_what_a_loop_by_hand_learns(name, num):
    made = []
    engine = engine_with(learner_of(name), made, num_envs=num)
    before = engine.begin()
    after = engine.advance(before, STEPS)
    shared, kept, worlds = by_hand(name, num)
    learnt = jax.tree.map(lambda leaf: leaf[0], engine.metered(after))
    for field in LEARNERS[name][1]:
        many = jax.tree.map(lambda *leaves: jnp.stack(leaves), *[own[field] for own in kept])
        alike(getattr(learnt, field), many)
        learnt = eqx.tree_at(operator.attrgetter(field), learnt, getattr(shared, field))
    alike(learnt, shared)
    moved = jax.tree.leaves(engine.learners(after))[0] - jax.tree.leaves(engine.learners(before))[0]
    assert np.abs(moved).max() > 1e-3
    for world, twin in zip(made[:num], worlds, strict=True):  # others judge
        np.testing.assert_allclose(world.given, twin.given, rtol=1e-4, atol=1e-4)
        assert world.episode > 2
    carried_out = [action for world in made for action in world.given]
    assert min(carried_out) < -0.5  # the whole box is used, and all of it once
    assert max(carried_out) > 2.5


@pytest.fixture(scope="module")
def pair():
    """Two learners, not yet begun, and their environments."""
    made = []
    return engine_with(learner_of("copdac-q"), made, seeds=2), made


def test_evaluating_changes_nothing(pair):
    engine, _ = pair
    whole = engine.advance(engine.begin(), 20)
    half = engine.advance(engine.begin(), 10)
    engine.play(engine.learners(half), episodes=3, seed=SEED)
    same(engine.advance(half, 10), whole)


def test_it_resumes_with_the_learners_in_new_episodes(pair):
    engine, made = pair
    state = engine.advance(engine.begin(), 11)  # in the middle of an episode
    made = made[:2]  # others play
    before = [list(world.starts) for world in made]
    resumed = engine.resume(state, 11)
    fresh = jnp.zeros_like(state.learner.deviation)
    same(resumed.learner, eqx.tree_at(lambda tree: tree.deviation, state.learner, fresh))
    assert np.any(state.learner.deviation != 0)
    assert int(resumed.steps[0]) == 11
    for world, starts in zip(made, before, strict=True):
        assert len(world.starts) == len(starts) + 1
        assert world.starts[-1] not in starts
    assert len({world.starts[-1] for world in made}) == 2
    same(engine.resume(state, 11), resumed)
    assert not engine.exact
    assert "new episode" in engine.resume_note


def test_a_lost_learner_leaves_the_other_alone(pair):
    engine, made = pair
    begun = engine.begin()
    learnt = engine.advance(begun, 10)
    engine.begin()
    spoilt = begun.learner.theta.at[1].set(jnp.nan)
    lost = engine.advance(eqx.tree_at(lambda tree: tree.learner.theta, begun, spoilt), 10)
    one, other = (jax.tree.map(lambda leaf: leaf[0], tree.learner) for tree in (lost, learnt))
    same(one, other)
    assert np.all(np.isnan(lost.learner.theta[1]))
    assert made[1].given[-1] == 1.0  # the centre of the box
    played = engine.play(engine.learners(lost), episodes=1, seed=SEED)
    assert np.isfinite(played.returns).tolist() == [[True], [False]]  # it was not its own


def played_by_hand(policy, gamma, value, episodes, seed):
    """Returns, lengths, discounted returns with the tail's value, of one learner."""
    world, rows = Slope(), []
    seen = world.reset(
        seed=int(np.random.SeedSequence([seed, 1]).generate_state(1)[0]) % (2**31 - 2**20)
    )[0]
    for _ in range(episodes):
        rewards, over = [], False
        while not over:
            action = legal(policy(seen)).astype("f")
            seen, reward, terminated, truncated, _ = world.step(action)
            rewards.append(reward)
            over = terminated or truncated
        tail = 0.0 if terminated else gamma ** len(rewards) * value(seen)
        weighed = sum(gamma**t * reward for t, reward in enumerate(rewards))
        rows.append((sum(rewards), len(rewards), weighed + tail))
        seen = world.reset()[0]
    return np.array(rows).T


def test_it_plays_what_a_loop_by_hand_plays(pair):
    engine, made = pair
    state = engine.advance(engine.begin(), 20)
    steps = [len(world.given) for world in made[:2]]
    learners = engine.learners(state)
    played = engine.play(learners, episodes=3, seed=8)
    for i in (0, 1):
        own = jax.tree.map(lambda leaf, i=i: leaf[i], learners)

        def value(seen, own=own):
            return float(engine.learner.state_value(own.v, jnp.asarray(seen)))

        expected = played_by_hand(
            lambda seen, own=own: engine.learner.greedy(own, jnp.asarray(seen)), 0.9, value, 3, 8
        )
        found = played.returns[i], played.lengths[i], played.discounted[i]
        np.testing.assert_allclose(found, expected, rtol=1e-4)
    assert played.lengths.tolist() == [[3, 4, 3]] * 2
    assert [
        len(world.given) for world in made[:2]
    ] == steps  # in other worlds than those of training
    assert np.any(engine.play(learners, episodes=3, seed=9).returns != played.returns)


def vector(mode, num):
    return lambda: SyncVectorEnv([Slope] * num, autoreset_mode=mode)


def test_calls_that_only_reset_teach_nothing():
    engine = engine_with(
        learner_of("stochastic-ac"), make=vector(AutoresetMode.NEXT_STEP, 2), num_envs=2
    )
    state, taught = engine.begin(), []
    for _ in range(10):
        after = engine.advance(state, 2)
        changed = jax.tree.map(lambda a, b: np.any(a != b), after.learner.u, state.learner.u)
        taught.append(any(jax.tree.leaves(changed)))
        state = after
    assert taught == [True] * 3 + [False] + [True] * 4 + [False] + [True]


def test_vector_environments_are_judged_as_single_ones(pair):
    plain, _ = pair
    learners = plain.learners(plain.begin())
    one = jax.tree.map(lambda leaf: leaf[:1], learners)
    expected = plain.play(learners, episodes=4, seed=1)
    for mode in AutoresetMode:
        copies = engine_with(plain.learner, make=vector(mode, 1))
        found = copies.play(one, episodes=4, seed=1)
        alike([column[:1] for column in expected], list(found))
    several = engine_with(plain.learner, make=vector(AutoresetMode.NEXT_STEP, 2), num_envs=2)
    found = several.play(one, episodes=4, seed=1)
    assert found.lengths.tolist() == [[3, 4, 3, 4]]
    np.testing.assert_allclose(found.returns[0, :2], expected.returns[0, :2], rtol=1e-5)
    assert found.returns[0, 0] != found.returns[0, 2]


def test_an_episode_that_does_not_end_is_given_up(monkeypatch):
    monkeypatch.setattr(judged, "LONGEST", 25)
    engine = engine_with(learner_of("copdac-q"), make=Endless)
    learners = engine.learners(engine.begin())
    said = (
        "An episode of 'Endless' did not end in 25 steps, and no time limit is known: give one "
        "(--time-limit N), or train without evaluations (--evaluation-episodes 0)."
    )
    with pytest.raises(ValueError, match=f"^{re.escape(said)}$"):
        engine.play(learners, episodes=1, seed=0)


def test_a_time_limit_ends_what_would_not():
    engine = engine_of(config(time_limit=6), Endless)
    engine.use(learner_of("copdac-q"))
    assert engine.spec.time_limit == 6
    played = engine.play(engine.learners(engine.begin()), episodes=2, seed=0)
    assert played.lengths.tolist() == [[6, 6]]


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match=r"has 3 copies, which is not seeds \* num_envs = 1 \* 1"):
        Hosted(config(), opened(make=vector(AutoresetMode.NEXT_STEP, 3)))
    bandit = ALGORITHMS["bandit-copdac"].create(SPEC)
    with pytest.raises(ValueError, match=r"batches of \d+ one-step episodes of a bandit, but 'Slo"):
        engine_with(bandit)


def test_worlds_are_closed():
    closed = []

    class Closing(Slope):
        def close(self):
            closed.append(self)

    engine = engine_with(learner_of("copdac-q"), make=Closing, seeds=2)
    engine.play(engine.learners(engine.begin()), episodes=1, seed=0)
    engine.close()
    assert len(closed) == 4
