"""`detpg.environments.PuddleWorld` for compiled loops."""

import math

import numpy as np

from detpg.environments.puddle_world import STEP, PuddleWorld
from detpg.kernels.compiling import piece
from detpg.kernels.random import uniform
from detpg.kernels.tasks.task import Task

# Beyond it a bump of 53 times 2 adds less than 1e-19, which 1 in double precision does not notice.
FAR = 50.0
BUMPS = 7  # index of the first bump: mean, reciprocal widths, height


def constants(world: PuddleWorld) -> np.ndarray:
    means, widths, depth = map(np.asarray, (world.bump_means, world.bump_widths, world.depth))
    heights = depth / (2 * np.pi * np.prod(widths, axis=1, keepdims=True))
    bumps = np.hstack([means, 1 / widths, heights]).ravel()
    return np.hstack([world.noise, world.start, world.goal, world.reach, depth, bumps])


@piece
def start(constants, stream, state):
    state[0], state[1] = constants[1], constants[2]


@piece
def move(constants, stream, state, action):
    noise = constants[0]
    for k in range(2):
        step = min(max(action[k], -STEP), STEP) + noise * (2 * uniform(stream) - 1)
        state[k] = min(max(state[k] + step, 0.0), 1.0)
    distance = abs(constants[3] - state[0]) + abs(constants[4] - state[1])
    return reward_at(constants, state), distance < constants[5]


@piece
def reward_at(constants, state):
    reward = -1.0
    for i in range(BUMPS, constants.size, 5):
        x = (state[0] - constants[i]) * constants[i + 2]
        y = (state[1] - constants[i + 1]) * constants[i + 3]
        exponent = 0.5 * (x * x + y * y)
        if exponent < FAR:
            reward -= constants[i + 4] * math.exp(-exponent)
    return reward


TASK = Task(constants, start, move, solved=-1000.0)
