"""`detpg.environments.MountainCar` for compiled loops."""

import math

import numpy as np

from detpg.environments.mountain_car import POSITION, SPEED, THROTTLE, MountainCar
from detpg.kernels.compiling import piece
from detpg.kernels.random import uniform
from detpg.kernels.tasks.task import Task

LOW, HIGH = POSITION


def constants(car: MountainCar) -> np.ndarray:
    numbers = (car.power, car.gravity, car.slope, car.goal, car.start, car.random_start)
    return np.array([float(x) for x in numbers])


@piece
def start(constants, stream, state):
    if constants[5] == 0.0:
        state[0], state[1] = constants[4], 0.0
    else:
        state[0] = LOW + (HIGH - LOW) * uniform(stream)
        state[1] = SPEED * (2 * uniform(stream) - 1)


@piece
def move(constants, stream, state, action):
    power, gravity, slope, goal = constants[0], constants[1], constants[2], constants[3]
    throttle = min(max(action[0], -THROTTLE), THROTTLE)
    v = state[1] + power * throttle - gravity * math.cos(slope * state[0])
    v = min(max(v, -SPEED), SPEED)
    p = state[0] + v
    state[0], state[1] = min(max(p, LOW), HIGH), v
    if p < LOW:
        state[1] = 0.0
    return -1.0, state[0] >= goal


TASK = Task(constants, start, move, solved=-1000.0)
