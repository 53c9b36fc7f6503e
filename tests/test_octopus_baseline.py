"""The baseline of the octopus benchmark does the same work."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from benchmarks.numpy_octopus import NumpyOctopus

from detpg.environments import OctopusArm


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("arms", [(), (3,)])
def test_the_plain_simulator_makes_the_same_steps(arms):
    world, random = OctopusArm(4, "B"), np.random.default_rng(1)
    plain = NumpyOctopus(world.parameters, arms)
    step = jax.jit(lambda state, action: world.transition(jax.random.key(0), state, action))
    theirs, ours = plain.initial(), [world.initial(jax.random.key(0))] * (arms or (1,))[0]
    for _ in range(2):
        actions = random.uniform(-0.5, 1.5, (14, *arms))
        theirs = plain.step(theirs, actions)
        each = actions.reshape(14, -1).T
        ours = [step(state, jnp.asarray(action)) for state, action in zip(ours, each, strict=True)]
    for n, state in enumerate(ours):
        for mine, other in zip(vars(state.arm).values(), theirs, strict=True):
            other = other[..., n] if arms else other
            np.testing.assert_allclose(mine, other, rtol=0, atol=1e-6)
