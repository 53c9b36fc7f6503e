"""The octopus arm against the public Java simulator's numbers, and against plain NumPy loops."""

import csv
import dataclasses
import os
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from octopus_reference import ReferenceArm

from detpg.environments import OctopusArm
from detpg.environments.octopus_arm.body import body_of
from detpg.environments.octopus_arm.geometry import distance, touches, turned
from detpg.environments.octopus_arm.integration import advance, sub_step
from detpg.environments.octopus_arm.observation import from_vector, to_vector
from detpg.environments.octopus_arm.physics import activate, derivative

FIXTURES = Path(__file__).parents[1] / "fixtures" / "octopus"

pytestmark = pytest.mark.usefixtures("x64")


def table(name):
    """The rows of a file as dictionaries."""
    with (FIXTURES / name).open() as file:
        return list(csv.DictReader(file))


def columns(rows, letter):
    """The columns of one letter and a number, in order."""
    names = [name for name in rows[0] if name[0] == letter and name[1:].isdigit()]
    return np.array([[float(row[name]) for name in names] for row in rows])


def consecutive(rows):
    """Pairs of rows that follow each other in one run: state, action taken there, next state."""
    pairs = [
        (i, i + 1)
        for i in range(len(rows) - 1)
        if int(rows[i + 1]["step"]) == int(rows[i]["step"]) + 1
        and rows[i].get("run") == rows[i + 1].get("run")
    ]
    before, after = np.array(pairs).T
    states = columns(rows, "s")
    return states[before], columns(rows, "a")[after], states[after]


@jax.jit
def rates_of(body, states, actions):
    def one(state, action):
        return to_vector(derivative(body, activate(body, action), from_vector(state)))

    return jax.vmap(one)(states, actions)


@jax.jit
def sub_steps_of(body, states, actions):
    def one(state, action):
        return to_vector(sub_step(body, activate(body, action), from_vector(state)))

    return jax.vmap(one)(states, actions)


@jax.jit
def steps_of(body, states, actions):
    def one(state, action):
        return to_vector(advance(body, action, from_vector(state)))

    return jax.vmap(one)(states, actions)


def close(found, expected, tolerance):
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)


def body(*arguments):
    return body_of(OctopusArm(*arguments).parameters)


def test_the_start_is_exact():
    world = OctopusArm()
    at_rest = columns(table("derivatives.csv"), "s")[-5]
    np.testing.assert_array_equal(world.to_vector(world.initial(jax.random.key(0))), at_rest)


def test_derivatives():
    rows = table("derivatives.csv")
    states, actions, expected = (columns(rows, letter) for letter in "sad")
    close(rates_of(body(), states, actions), expected, 1e-12)
    # The oracle for all other parameters agrees too.
    reference = ReferenceArm(OctopusArm().parameters)
    close([reference.derivative(*pair) for pair in zip(states, actions)], expected, 1e-12)
    # So does the environment's method, one state at a time.
    world = OctopusArm()
    rate = world.derivative(world.from_vector(jnp.asarray(states[-1])), jnp.asarray(actions[-1]))
    close(to_vector(rate), expected[-1], 1e-12)


def test_sub_steps():
    states, actions, expected = consecutive(table("sub_steps.csv"))
    assert len(states) == 28
    close(sub_steps_of(body(), states, actions), expected, 1e-12)


@pytest.mark.parametrize(("file", "segments"), [("steps.csv", 6), ("steps_of_8_segments.csv", 8)])
def test_environment_steps(file, segments):
    states, actions, expected = consecutive(table(file))
    # One step can spread the last bits by a factor of 1e7: see the README of the fixtures.
    close(steps_of(body(segments), states, actions), expected, 1e-6)


def constant_action(run):
    """The action that the name of a run says."""
    world = OctopusArm()
    action = np.zeros((world.spec.action_size,))
    for word in run.removesuffix("_on").removeprefix("base_").split("_"):
        group = {
            "zero": slice(0),
            "ccw": slice(0, 1),
            "cw": slice(1, 2),
            "dorsal": slice(2, None, 3),
            "transversal": slice(3, None, 3),
            "ventral": slice(4, None, 3),
        }[word]
        action[group] = 1
    return action


def run_of_100(parameters, actions):
    """The states of runs from rest, one constant action each: (run, step, number)."""
    world = OctopusArm(6, parameters)
    arm = world.initial(jax.random.key(0)).arm

    def play(body, actions):
        def one(action):
            def move(arm, _):
                moved = advance(body, action, arm)
                return moved, moved

            return jax.lax.scan(move, arm, length=100)[1]

        return jax.vmap(one)(actions)

    # Rounded as users' programs are: set B spreads the last bits beyond what is compared.
    older = "fusion_emitters" in os.environ["XLA_FLAGS"]
    as_users = {"xla_cpu_use_fusion_emitters": True} if older else None
    play = jax.jit(play, compiler_options=as_users)
    return play(body_of(world.parameters), jnp.asarray(actions))


def test_runs_that_are_not_chaotic():
    rows = table("free_runs.csv")
    runs = sorted({row["run"] for row in rows})
    arms = run_of_100("A", [constant_action(run) for run in runs])
    for row, expected in zip(rows, columns(rows, "s")):
        place = runs.index(row["run"]), int(row["step"]) - 1
        close(to_vector(jax.tree.map(lambda leaf, at=place: leaf[at], arms)), expected, 1e-9)


# How far runs of 100 steps may drift: set B spreads the last bits within them.
DRIFT = {"A": 1e-9, "B": 1e-2}


@pytest.mark.parametrize("parameters", ["A", "B"])
def test_hits_and_distances(parameters):
    rows = [row for row in table("hits.csv") if row["geometry"] == parameters]
    runs = sorted({row["scenario"] for row in rows})
    arms = run_of_100(parameters, [constant_action(run) for run in runs])
    targets = jnp.asarray([[float(row["target_x"]), float(row["target_y"])] for row in rows])
    which = jnp.asarray([runs.index(row["scenario"]) for row in rows])
    start = OctopusArm(6, parameters).initial(jax.random.key(0)).arm

    @jax.jit
    def measured(body, arms, targets):
        def seen(arm, target):
            return distance(body, arm, target), touches(body, arm, target)

        def of_run(run, target):
            run = jax.tree.map(lambda leaf: leaf[run], arms)
            return jax.vmap(seen, in_axes=(0, None))(run, target)

        at_start = jax.vmap(lambda target: distance(body, start, target))(targets)
        return at_start, *jax.vmap(of_run)(which, targets)

    body = body_of(OctopusArm(6, parameters).parameters)
    at_start, away, hit = (np.asarray(value) for value in measured(body, arms, targets))
    first = np.where(hit.any(axis=1), hit.argmax(axis=1) + 1, -1)
    assert first.tolist() == [int(row["first_hit_step"]) for row in rows]
    close(at_start, [float(row["min_node_dist_at_step0"]) for row in rows], 1e-12)
    least = np.minimum(away.min(axis=1), at_start)
    drift = np.abs(least - [float(row["min_node_dist_over_run"]) for row in rows])
    assert drift.max() < DRIFT[parameters]
    early = [int(row["step_of_min"]) <= 10 for row in rows]
    assert sum(early) >= 10
    assert drift[early].max() < 1e-6


def own_parameters():
    """Bent, not alike on both sides, in shallow water with every constant changed."""
    random = np.random.default_rng(5)
    known = OctopusArm(4, "B").parameters
    changes = {
        name: value * (0.5 + random.random(value.shape))
        for name, value in vars(known).items()
        if name not in ("upper", "lower")
    }
    upper = known.upper + 0.2 * random.standard_normal((5, 2))
    lower = known.lower + 0.2 * random.standard_normal((5, 2))
    return dataclasses.replace(
        known, **changes | {"upper": upper, "lower": lower, "surface_level": 0.8}
    )


@pytest.mark.parametrize("case", ["A", "A of one segment", "B", "B of twelve", "own"])
def test_any_parameters_against_plain_loops(case):
    segments = {"A of one segment": 1, "B of twelve": 12, "own": None}.get(case, 6)
    world = OctopusArm(segments, own_parameters() if case == "own" else case[0])
    reference, random = ReferenceArm(world.parameters), np.random.default_rng(7)
    start = np.asarray(world.to_vector(world.initial(jax.random.key(0))))
    states = start + 0.15 * random.standard_normal((6, len(start)))
    # Wild ones too: slack muscles, compartments turned inside out, nodes above the surface.
    states[3:] += 1.5 * random.standard_normal((3, len(start)))
    states[5, 3::4] += 5.0
    actions = random.uniform(-0.5, 1.5, (6, world.spec.action_size))
    body = body_of(world.parameters)
    expected = np.array([reference.derivative(*pair) for pair in zip(states, actions)])
    scale = np.maximum(1, np.abs(expected))
    close(rates_of(body, states, actions) / scale, expected / scale, 1e-12)
    if world.parameters.num_segments == 6:
        expected = [reference.step(*pair) for pair in zip(states[:2], actions[:2])]
        close(steps_of(body, states[:2], actions[:2]), expected, 1e-6)


def mirrored(state, action):
    """The same in a mirror along x: sides change places, angles their sense."""
    nodes = state[2:].reshape(2, -1, 4)[::-1] * np.array([1, -1, 1, -1])
    base, muscles = action[1::-1], action[2:].reshape(-1, 3)[:, ::-1]
    angles = np.array([np.pi - state[0], -state[1]])
    return np.concatenate([angles, nodes.reshape(-1)]), np.concatenate([base, muscles.reshape(-1)])


def test_a_mirrored_arm_moves_as_in_a_mirror():
    states, actions, _ = consecutive(table("steps.csv"))
    in_mirror = [np.array(x) for x in zip(*(mirrored(*pair) for pair in zip(states, actions)))]
    rates, mirror_rates = (rates_of(body(), *x) for x in ((states, actions), in_mirror))
    expected = np.array([mirrored(np.asarray(rate), a)[0] for rate, a in zip(rates, actions)])
    expected[:, 0] -= np.pi  # a rate has no origin
    close(mirror_rates, expected, 1e-12)


def test_the_angle_is_wrapped_at_the_start_of_a_step_only():
    world, action = OctopusArm(), constant_action("base_ccw")
    arm = turned(body(), world.initial(jax.random.key(0)).arm, jnp.asarray(np.pi / 2 - 0.01))
    states, angles = np.asarray(to_vector(arm))[None], []
    for _ in range(3):
        again = states + np.where(np.arange(states.shape[1]) == 0, 2 * np.pi, 0.0)
        states, after_again = (
            np.asarray(steps_of(body(), s, action[None])) for s in (states, again)
        )
        close(after_again, states, 1e-6)
        angles.append(states[0, 0])
    assert angles[0] > np.pi
    assert angles[1] < -2
