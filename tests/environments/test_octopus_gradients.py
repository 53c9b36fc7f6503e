"""The octopus arm in batches, and its gradients."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.environments import OctopusArm
from detpg.environments.octopus_arm import State
from detpg.environments.octopus_arm.body import body_of
from detpg.environments.octopus_arm.integration import sub_step
from detpg.environments.octopus_arm.physics import activate

KEY = jax.random.key(0)


@pytest.mark.slow
@pytest.mark.usefixtures("x64")
def test_batches_are_their_members_alone():
    """Over states, over actions, over parameters, and one within the other."""
    world = OctopusArm(2)
    random = np.random.default_rng(0)
    start = np.asarray(world.to_vector(world.initial(KEY)))
    states = jnp.asarray(start + 0.1 * random.standard_normal((3, 18)))
    actions = jnp.asarray(random.random((2, 8)))
    pressures = jnp.asarray([10.0, 20.0])

    def one(pressure, action, state):
        parameters = dataclasses.replace(world.parameters, pressure=pressure)
        changed = dataclasses.replace(world, parameters=parameters)
        return changed.to_vector(changed.transition(KEY, world.from_vector(state), action))

    alone = jax.jit(one)
    expected = np.array([[[alone(p, a, s) for s in states] for a in actions] for p in pressures])
    inner = jax.vmap(one, in_axes=(None, None, 0))
    whole = jax.vmap(jax.vmap(inner, in_axes=(None, 0, None)), in_axes=(0, None, None))
    np.testing.assert_allclose(jax.jit(whole)(pressures, actions, states), expected, atol=1e-8)
    over_actions = jax.vmap(one, in_axes=(None, 0, None))
    found = jax.jit(over_actions)(pressures[0], actions, states[0])
    np.testing.assert_allclose(found, expected[0, :, 0], atol=1e-8)
    assert np.ptp(expected, axis=0).max() > 1e-3


def value(world, state, action):
    """Some number of the next state, and the reward."""
    moved = world.transition(KEY, state, action)
    return jnp.sum(world.to_vector(moved)) + world.reward(state, action, moved)


def test_gradients_are_finite_also_at_rest():
    world = OctopusArm(3)
    rest = world.initial(KEY)
    on_a_node = dataclasses.replace(rest, target=jnp.stack([rest.arm.x[0, 1], rest.arm.y[0, 1]]))
    states = [rest, on_a_node]
    for seed in range(4):
        noise = jax.random.normal(jax.random.key(seed), (26,))
        states.append(world.from_vector(world.to_vector(rest) + 0.1 * noise))
    states = jax.tree.map(lambda *leaves: jnp.stack(leaves), *states)
    slope = jax.vmap(jax.grad(value, argnums=(0, 1, 2)), in_axes=(None, 0, None))
    found = jax.jit(slope)(world, states, 0.5 * jnp.ones(11, dtype=float))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(found))
    # No number of the state, and no action, is without effect.
    assert all(np.abs(leaf).max(axis=0).all() for leaf in jax.tree.leaves(found[1].arm))
    assert np.abs(found[2]).max(axis=0).all()


@pytest.mark.slow
@pytest.mark.usefixtures("x64")
def test_slopes_agree_with_finite_differences():
    world, random = OctopusArm(2), np.random.default_rng(2)
    body, action = body_of(world.parameters), jnp.asarray(random.random(8))
    rest = np.asarray(world.to_vector(world.initial(KEY)))
    start = jnp.asarray(rest + 0.1 * random.standard_normal(18))
    way = jnp.asarray(random.standard_normal(18))

    def ahead(h):
        arm = world.from_vector(start + h * way).arm
        return world.to_vector(State(sub_step(body, activate(body, action), arm), world.target))

    @jax.jit
    def measured(h):
        differences = (ahead(h) - ahead(-h)) / (2 * h)
        return differences, jax.jacfwd(ahead)(0 * h), jax.jacrev(ahead)(0 * h)

    differences, forward, backward = measured(1e-6)
    # The differences are off by h^2 times the third derivative, 1e5 here, and by 1e-16 / h.
    np.testing.assert_allclose(forward, differences, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(backward, forward, rtol=1e-9, atol=1e-12)
