"""Stop 1: the world, p_1, p and r of Section 2.1.

In: an action. Out: the next state, its observation, a reward, whether the episode terminated.
Next: the observation goes to a policy (`detpg.policies`).
"""

from detpg.environments.bandit import QuadraticBandit
from detpg.environments.lqr import LQR
from detpg.environments.mountain_car import MountainCar
from detpg.environments.octopus_arm import OctopusArm
from detpg.environments.pendulum import Pendulum
from detpg.environments.puddle_world import PuddleWorld
from detpg.environments.scaled_actions import ScaledActions
from detpg.environments.time_limited import TimeLimited
from detpg.types import Environment

ENVIRONMENTS: dict[str, type[Environment]] = {
    "bandit": QuadraticBandit,
    "lqr": LQR,
    "mountain-car": MountainCar,
    "octopus-arm": OctopusArm,
    "pendulum": Pendulum,
    "puddle-world": PuddleWorld,
}

__all__ = [
    "ENVIRONMENTS",
    "LQR",
    "MountainCar",
    "OctopusArm",
    "Pendulum",
    "PuddleWorld",
    "QuadraticBandit",
    "ScaledActions",
    "TimeLimited",
]
