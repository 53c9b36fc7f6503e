"""The octopus arm as an environment: its task, its starts, its targets."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.environments import OctopusArm
from detpg.environments.octopus_arm import PARAMETERS, TARGETS, OctopusParameters
from detpg.environments.octopus_arm.body import body_of, nodes
from detpg.environments.octopus_arm.geometry import distance, touches
from detpg.environments.octopus_arm.targets import reach

KEY = jax.random.key(0)


@jax.jit
def move(world, state, action):
    """One step: next state, reward, whether it hit."""
    moved = world.transition(KEY, state, action)
    return moved, world.reward(state, action, moved), world.terminated(moved)


def full(world, *indices):
    return jnp.asarray(np.isin(np.arange(world.spec.action_size), indices), dtype=float)


# --- the task ---


@pytest.mark.parametrize(("segments", "numbers", "actions"), [(None, 50, 20), (8, 66, 26)])
def test_the_papers_sizes(segments, numbers, actions):
    spec = OctopusArm(segments).spec
    assert (spec.observation_size, spec.action_size) == (numbers, actions)
    assert (spec.action_low, spec.action_high) == ((0.0,) * actions, (1.0,) * actions)
    assert spec.time_limit == 300


def test_an_arm_that_rests_observes_its_nodes():
    world = OctopusArm()
    seen = np.asarray(world.observe(world.initial(KEY)))
    assert seen[0] == np.float32(np.pi / 2)
    sides = seen[2:].reshape(2, 6, 4)
    assert not sides[:, :, 2:].any()
    np.testing.assert_array_equal(sides[0, :, :2], world.parameters.upper[1:])
    np.testing.assert_array_equal(sides[1, :, :2], world.parameters.lower[1:])


def test_a_state_goes_to_a_vector_and_back():
    world = OctopusArm(4)
    vector = jax.random.normal(KEY, (34,))
    np.testing.assert_array_equal(world.to_vector(world.from_vector(vector)), vector)


def unit_square(target):
    """One square segment from (0, 0) to (1, 1), whose nodes are easily counted."""
    corners = {"upper": [[0.0, 1.0], [1.0, 1.0]], "lower": [[0.0, 0.0], [1.0, 0.0]]}
    known = {"friction_tangential": 0.2, "muscle_passive": 0.05, "muscle_min_length": 0.4}
    parameters = OctopusParameters(mass=[1.0, 1.0], muscle_damping=0.3, **known, **corners)
    return OctopusArm(parameters=parameters, target=target, distance_weight=2.0)


def test_reward_by_hand():
    world = unit_square((0.8, 1.3))
    start, before = world.initial(KEY), math.hypot(0.2, 0.3)
    # Both free nodes half a unit further: the nearest node goes from (1, 1) to (1.5, 1).
    arm = dataclasses.replace(start.arm, x=start.arm.x + 0.5)
    further = dataclasses.replace(start, arm=arm)
    expected = 2 * (before - math.hypot(0.7, 0.3))
    assert float(world.reward(start, full(world), further)) == pytest.approx(expected, rel=1e-5)
    # One half a unit higher: the nearest node is at (1, 1.5) and the target inside.
    higher = dataclasses.replace(start, arm=dataclasses.replace(start.arm, y=start.arm.y + 0.5))
    assert bool(world.terminated(higher))
    expected = 2 * (before - math.hypot(0.2, 0.2)) + 50
    assert float(world.reward(start, full(world), higher)) == pytest.approx(expected, rel=1e-5)


def test_the_distance_is_that_to_the_nearest_of_all_nodes():
    world = unit_square((1.0, 1.2))
    arm, body = world.initial(KEY).arm, body_of(world.parameters)
    for point, expected in [((1.5, 1.0), 0.5), ((-3.0, -4.0), 5.0), ((0.5, 0.5), 0.5**0.5)]:
        assert float(distance(body, arm, jnp.asarray(point))) == pytest.approx(expected)


def winding_number(corners, point):
    """Sum of the angles under which the edges are seen from the point, in turns."""
    seen = np.arctan2(corners[:, 1] - point[1], corners[:, 0] - point[0])
    angles = np.diff(np.append(seen, seen[0]))
    return round(float(np.sum((angles + np.pi) % (2 * np.pi) - np.pi)) / (2 * np.pi))


def test_what_a_compartment_winds_around_is_hit():
    random = np.random.default_rng(3)
    world = OctopusArm()
    body = body_of(world.parameters)
    hit = jax.jit(jax.vmap(lambda arm, point: touches(body, arm, point)))
    # Wild arms: crossed outlines, either sense of turning.
    rest = np.asarray(world.to_vector(world.initial(KEY)))
    vectors = rest + 0.7 * random.standard_normal((200, 50))
    points = random.uniform((0, -1), (6, 1), (200, 2))
    arms = jax.vmap(lambda vector: world.from_vector(vector).arm)(jnp.asarray(vectors, float))
    found = np.asarray(hit(arms, jnp.asarray(points, float)))
    x, y = (np.asarray(value) for value in jax.vmap(lambda arm: nodes(body, arm))(arms))
    for n, point in enumerate(points):
        upper, lower = np.stack([x[n], y[n]], axis=-1)
        outlines = zip(upper[:-1], upper[1:], lower[1:], lower[:-1])
        assert found[n] == any(winding_number(np.array(o), point) for o in outlines)
    assert 20 < found.sum() < 180


def test_an_arm_that_bends_towards_the_target_hits_it():
    world = OctopusArm(target="near")
    state, action = world.initial(KEY), full(world, 0, *range(2, 20, 3))
    total = 0.0
    for _ in range(23):  # the public Java simulator's steps, tests/fixtures/octopus/hits.csv
        assert not bool(world.terminated(state))
        state, reward, _ = move(world, state, action)
        total += float(reward)
    assert bool(world.terminated(state))
    body = body_of(world.parameters)
    start = float(distance(body, world.initial(KEY).arm, world.target))
    # The rewards telescope to the distance won.
    assert total == pytest.approx(50 + start - float(distance(body, state.arm, world.target)), 1e-4)


def test_actions_are_capped():
    world = OctopusArm(2)
    state, action = world.initial(KEY), jnp.asarray([3.0, -1.0, 2.0, -5.0, 0.5, 1.0, 0.0, 7.0])
    capped = jnp.clip(action, 0.0, 1.0)
    for found, expected in zip(
        *map(jax.tree.leaves, (move(world, state, a) for a in (action, capped)))
    ):
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("index", [0, 4])
def test_an_action_that_is_no_number_is_seen_in_every_number_that_follows(index):
    world = OctopusArm(2)
    state, reward, hit = move(world, world.initial(KEY), full(world).at[index].set(jnp.nan))
    assert not np.isfinite(world.observe(state)).any()
    assert not np.isfinite(reward)
    assert not bool(hit)


def test_macro_actions_are_the_primitives():
    actions = np.asarray(OctopusArm(5).macro_actions)
    assert actions.shape == (8, 17)
    assert actions[0].nonzero()[0].tolist() == [0]
    assert actions[1].nonzero()[0].tolist() == [1]
    # Dorsal, transversal, ventral: two segments at the base, three at the tip.
    assert actions[2].nonzero()[0].tolist() == [2, 5]
    assert actions[4].nonzero()[0].tolist() == [4, 7]
    assert actions[6].nonzero()[0].tolist() == [9, 12, 15]
    assert (actions.sum(axis=0)[2:] == 1).all()


# --- starts and targets ---


def test_start_noise_turns_the_whole_arm():
    world = OctopusArm(start_noise=0.3)
    states = jax.jit(jax.vmap(world.initial))(jax.random.split(KEY, 400))
    turn = np.asarray(states.arm.theta) - np.pi / 2
    assert np.abs(turn).max() <= 0.3
    # Uniform: the mean is 0 and the standard deviation 0.3 / sqrt(3), each within 4 of its error.
    assert abs(turn.mean()) < 4 * 0.3 / math.sqrt(3 * 400)
    assert abs(turn.std() - 0.3 / math.sqrt(3)) < 4 * 0.3 / math.sqrt(3 * 400)
    body = body_of(world.parameters)
    x, y = jax.vmap(lambda arm: nodes(body, arm))(states.arm)
    length = np.hypot(
        np.asarray(x) - np.asarray(body.base_x), np.asarray(y) - np.asarray(body.base_y)
    )
    np.testing.assert_allclose(length, np.broadcast_to(length[:1], length.shape), rtol=1e-5)


def test_random_targets_are_seen_and_keep_clear_of_the_arm():
    world = OctopusArm(8, random_targets=True, start_noise=0.5)

    @jax.jit
    @jax.vmap
    def begun(key):
        state = world.initial(key)
        return state, world.observe(state), world.terminated(state)

    states, seen, ended = begun(jax.random.split(KEY, 1000))
    assert world.spec.observation_size == seen.shape[1] == 68
    np.testing.assert_array_equal(seen[:, -2:], states.target)
    assert not ended.any()
    length = float(world.parameters.upper[-1, 0])
    away = np.hypot(*np.asarray(states.target).T) / length
    assert away.min() > 0.19
    assert away.max() < 0.91
    # All around: each quadrant has its share.
    quadrant = np.floor(np.arctan2(*np.asarray(states.target).T) / (np.pi / 2)).astype(int)
    assert min(np.unique(quadrant, return_counts=True)[1]) > 150


def test_named_targets_scale_with_the_arm():
    for name, place in TARGETS.items():
        np.testing.assert_allclose(OctopusArm(target=name).target, place)
        np.testing.assert_allclose(OctopusArm(9, target=name).target, np.multiply(1.5, place))
    # The default is RL-Library's target for its ten segments.
    np.testing.assert_allclose(OctopusArm(10).target, OctopusArm(10, target="rl-library").target)


def test_a_target_out_of_reach_is_warned_of():
    with pytest.warns(
        UserWarning, match=r"^target \(6, 5\) is 7.81 from the base; .* about 7.48[.]$"
    ):
        OctopusArm(target="rl-library")


@pytest.mark.parametrize("parameters", PARAMETERS)
def test_reach_is_about_how_far_a_stretching_arm_gets(parameters):
    world = OctopusArm(6, parameters)
    state, action, far = world.initial(KEY), full(world, *range(3, 20, 3)), 0.0
    for _ in range(12):
        state = move(world, state, action)[0]
        far = max(far, float(state.arm.x.max() - body_of(world.parameters).base_x[0, 0]))
    assert reach(world.parameters) == pytest.approx(far, rel=0.07)


def test_observations_can_be_scaled():
    raw, unit = OctopusArm(), OctopusArm(observation_scale="unit")
    state = raw.initial(KEY)
    np.testing.assert_allclose(unit.observe(state) * unit.observation_scale, raw.observe(state))
    assert np.abs(unit.observe(state)).max() < 2
    twice = OctopusArm(observation_scale=[2.0] * 50)
    np.testing.assert_allclose(2 * twice.observe(state), raw.observe(state))
