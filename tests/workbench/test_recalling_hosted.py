"""What a learner remembers of worlds that the host steps, against what those worlds did."""

import jax
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from slope import LENGTHS, Slope

from detpg.algorithms import TD3
from detpg.critics import EnsembleActionValues
from detpg.integrations.gymnasium.worlds import open_worlds
from detpg.policies import NetworkPolicy
from detpg.types import EnvironmentSpec
from detpg.workbench import Config
from detpg.workbench.hosted import Hosted
from detpg.wrappers import Metered, Normalised

SPEC = EnvironmentSpec("Slope", 2, 1, (-1.0,), (1.0,), 4, 0.9)
WARM_UP, STEPS = 12, 36


def learner():
    inner = TD3.create(
        SPEC,
        policy=NetworkPolicy(2, 1, (4,)),
        action_values=EnsembleActionValues(2, 1, (4,)),
        batch=4,
        warm_up=WARM_UP,
        sigma=3.0,
    )
    wrapped = Normalised.create(SPEC, algorithm=inner, rewards=True)
    return Metered.create(SPEC, algorithm=wrapped)


def engine(make, num_envs):
    config = Config("td3", "Slope", seed=5, steps=STEPS, log_every=num_envs, num_envs=num_envs)
    driven = Hosted(config, lambda num: open_worlds(make(num), num))
    driven.use(learner())
    return driven


MAKES = {
    "plain": lambda num: Slope,
    "next step": lambda num: SyncVectorEnv([Slope] * num, autoreset_mode=AutoresetMode.NEXT_STEP),
    "same step": lambda num: SyncVectorEnv([Slope] * num, autoreset_mode=AutoresetMode.SAME_STEP),
}


@pytest.mark.parametrize("make", MAKES)
def test_what_is_remembered_happened(make):
    """No row of a reset, s' before it, the action as it was carried out, ends told apart."""
    driven = engine(MAKES[make], num_envs=2)
    state = driven.advance(driven.begin(), STEPS)
    memory = jax.tree.map(np.asarray, state.memory[0])
    for world in range(2):
        rows = memory.rows[world][: memory.added[world]]
        assert len(rows) == STEPS // 2 or make == "next step"
        s, a, after = rows[:, :2], rows[:, 2], rows[:, 3:5]
        x = 0.8 * s[:, 0] + 0.2 * (1 + 2 * a)  # the box is [-1, 3]
        np.testing.assert_allclose(after[:, 0], x, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(after[:, 1], s[:, 1] + 0.25, rtol=1e-6)
        np.testing.assert_allclose(rows[:, 5], -((x - 1) ** 2), rtol=1e-4, atol=1e-6)
        assert np.all(np.abs(a) <= 1)
        assert np.any(np.abs(a) == 1)  # noise of three half ranges was cut off
        ended = np.flatnonzero(rows[:, 6] + rows[:, 7] > 0)
        for k, (end, before) in enumerate(zip(ended, [-1, *ended])):
            length, terminal = LENGTHS[k % 2]
            assert end - before == length
            assert (rows[end, 6], rows[end, 7]) == (terminal, not terminal)
        assert np.all(s[1:, 1] == np.where(rows[:-1, 6] + rows[:-1, 7] > 0, 0, after[:-1, 1]))
    learnt, seen = state.learner.learner, memory.added.sum()
    assert int(learnt.observations.count[0]) == seen  # once each, never from what is recalled
    updates = int(learnt.learner.updates[0])
    assert updates == 2 * ((STEPS - WARM_UP) // 2 + 1)  # from the call on that ends the warm-up
    assert float(state.learner.meter.updates[0]) == updates
    assert float(state.learner.meter.steps[0]) == seen


def test_actions_are_anywhere_in_the_box_before_there_is_anything_to_learn_from():
    driven = engine(MAKES["plain"], num_envs=2)
    state = driven.begin()
    actions = []
    for _ in range(WARM_UP // 2 - 1):
        state = driven.advance(state, 2)
        actions.append(np.asarray(state.action))
    noise = np.asarray(state.learner.learner.learner.noise.stretch)
    assert noise.shape[:2] == (1, 2)
    assert np.any(noise[0, 0] != noise[0, 1])  # each world has its own
    assert np.all(np.abs(actions) < 1)  # sigma would have cut most of them off
