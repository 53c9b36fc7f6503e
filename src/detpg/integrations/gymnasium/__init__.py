"""The environments under Gymnasium's interface: one world, or a batch of them compiled as one.

Importing this module registers every environment of `detpg.environments.ENVIRONMENTS` as
`detpg/<class>-v0`; keyword arguments of `gymnasium.make` go to the class:

    import gymnasium
    import detpg.integrations.gymnasium

    world = gymnasium.make("detpg/OctopusArm-v0", num_segments=8)
    worlds = gymnasium.make_vec("detpg/OctopusArm-v0", num_envs=256)
"""

import gymnasium

from detpg.environments import ENVIRONMENTS
from detpg.integrations.gymnasium.single import GymnasiumEnv
from detpg.integrations.gymnasium.vector import GymnasiumVectorEnv


def _register() -> None:
    for name, environment in ENVIRONMENTS.items():
        gymnasium.register(
            id=f"detpg/{environment.__name__}-v0",
            entry_point=f"{__name__}:GymnasiumEnv",
            vector_entry_point=f"{__name__}:GymnasiumVectorEnv",
            kwargs={"environment": name},
        )


_register()

__all__ = ["GymnasiumEnv", "GymnasiumVectorEnv"]
