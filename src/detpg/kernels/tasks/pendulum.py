"""`detpg.environments.Pendulum` for compiled loops."""

import math

import numpy as np

from detpg.environments.pendulum import SPEED, TORQUE, Pendulum
from detpg.kernels.compiling import piece
from detpg.kernels.random import uniform
from detpg.kernels.tasks.task import Task


def constants(rod: Pendulum) -> np.ndarray:
    numbers = (rod.gravity, rod.friction, rod.step, rod.start, rod.random_start)
    return np.array([float(x) for x in numbers])


@piece
def start(constants, stream, state):
    state[0], state[1] = constants[3], 0.0
    if constants[4] != 0.0:
        state[0] = math.pi * (2 * uniform(stream) - 1)


@piece
def move(constants, stream, state, action):
    gravity, friction, step = constants[0], constants[1], constants[2]
    torque = min(max(action[0], -TORQUE), TORQUE)
    v = state[1] + (gravity * math.sin(state[0]) + torque - friction * state[1])
    v = min(max(v, -SPEED), SPEED)
    angle = state[0] + step * v
    if angle >= math.pi:
        angle -= 2 * math.pi
    if angle < -math.pi:
        angle += 2 * math.pi
    state[0], state[1] = angle, v
    return math.cos(angle), False


TASK = Task(constants, start, move, solved=4000.0)
