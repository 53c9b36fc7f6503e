"""The environments under Gymnasium's interface: one world, or a batch of them compiled as one.

`import detpg` registers every environment of `detpg.environments.ENVIRONMENTS` as
`detpg/<class>-v0`; keyword arguments of `gymnasium.make` go to the class:

    import detpg
    import gymnasium

    world = gymnasium.make("detpg/OctopusArm-v0", num_segments=8)
    worlds = gymnasium.make_vec("detpg/OctopusArm-v0", num_envs=256)
"""

from detpg.integrations.gymnasium.single import GymnasiumEnv
from detpg.integrations.gymnasium.vector import GymnasiumVectorEnv
from detpg.integrations.registration import register

register()

__all__ = ["GymnasiumEnv", "GymnasiumVectorEnv"]
