"""The octopus arm of Section 5.3, in rooms.

In: the parameters (`parameters`) and an action. On the way: the arm at rest and its measures
(`body`), forces (`physics`), 25 Runge-Kutta steps (`integration`), where a point lies (`geometry`,
`targets`). Out: the environment (`task`).
"""

from detpg.environments.octopus_arm.observation import State
from detpg.environments.octopus_arm.parameters import PARAMETERS, OctopusParameters
from detpg.environments.octopus_arm.targets import TARGETS
from detpg.environments.octopus_arm.task import OctopusArm

__all__ = ["PARAMETERS", "TARGETS", "OctopusArm", "OctopusParameters", "State"]
