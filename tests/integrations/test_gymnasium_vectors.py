"""Vector environments of one's own, and compiled batches, as worlds that a learner is driven by."""

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv

from detpg.integrations.gymnasium.worlds import Step, open_worlds
from detpg.world_error import WorldError

ONE = Box(-1.0, 1.0, (1,))


class OneGenerator(VectorEnv):
    """A vector environment of one's own: one seed for all copies, resets in the same step."""

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012
    num_envs = 2
    single_observation_space = observation_space = Box(-1.0, 9.0, (1,))
    single_action_space = ONE
    action_space = Box(-1.0, 1.0, (2, 1))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.np_random.uniform(size=(2, 1)), {}

    def step(self, actions):
        over = np.array([False, True])
        info = {"final_obs": np.array([[5.0], [6.0]])} if self.tells else {}
        return np.array([[0.25], [0.5]]), np.ones(2), over, ~over & False, info

    tells = True


def test_a_vector_environment_of_ones_own():
    worlds = open_worlds(OneGenerator())
    np.testing.assert_array_equal(worlds.reset([8, 1]), worlds.reset([8, 2]))
    step = worlds.step(np.zeros((2, 1)))
    np.testing.assert_array_equal(step.next_observation, [[0.25], [6.0]])
    np.testing.assert_array_equal(step.observation, [[0.25], [0.5]])
    silent = OneGenerator()
    silent.tells = False
    worlds = open_worlds(silent)
    worlds.reset([0, 0])
    with pytest.raises(
        WorldError, match=r"no info\['final_obs'\], though .*: make it with autoreset_m"
    ):
        worlds.step(np.zeros((2, 1)))
    silent.metadata = {}
    with pytest.raises(
        ValueError, match=r"^OneGenerator does not say when .* NextStep, SameStep, "
    ):
        open_worlds(silent)


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_compiled_batch_is_driven(mode):
    options = {"start": 0.59, "autoreset_mode": mode}
    worlds = open_worlds(gymnasium.make_vec("detpg/MountainCar-v0", 2, **options))
    observation = worlds.reset([0, 1])
    for _ in range(8):
        step: Step = worlds.step(np.ones((2, 1)))
        np.testing.assert_array_equal(step.valid, observation[:, 0] < 0.6)
        np.testing.assert_array_equal(
            step.terminated, step.valid & (step.next_observation[:, 0] >= 0.6)
        )
        observation = step.observation
    assert worlds.render() is None
    worlds.close()
