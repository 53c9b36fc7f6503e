"""Gymnasium knows the environments of this library by their ids, without importing JAX for it.

Gymnasium imports no package by itself since its version 1.0, so that `import detpg` registers,
before `import gymnasium` or after it; so does the module in `gymnasium.make("detpg:detpg/LQR-v0")`.
"""

import importlib.util
import sys
from collections.abc import Callable
from typing import Any

# Those of `detpg.environments.ENVIRONMENTS`: named here, for that registry imports JAX.
CLASSES = {
    "bandit": "QuadraticBandit",
    "lqr": "LQR",
    "mountain-car": "MountainCar",
    "octopus-arm": "OctopusArm",
    "pendulum": "Pendulum",
    "puddle-world": "PuddleWorld",
}
IDS = {f"detpg/{kind}-v0": name for name, kind in CLASSES.items()}
HOME = "detpg.integrations.gymnasium"


def register() -> None:
    """Registers every id that Gymnasium does not know yet; once more changes nothing."""
    import gymnasium

    for id_, name in IDS.items():
        if id_ not in gymnasium.registry:
            gymnasium.register(
                id=id_,
                entry_point=f"{HOME}:GymnasiumEnv",
                vector_entry_point=f"{HOME}:GymnasiumVectorEnv",
                kwargs={"environment": name},
            )


def register_when_imported() -> None:
    """Registers now, or as soon as Gymnasium is imported: it is not imported for this."""
    if "gymnasium" in sys.modules:
        register()
    else:
        sys.meta_path.insert(0, _Waiting())


class _Waiting:
    """Goes before the finders of modules until Gymnasium is imported."""

    def __init__(self) -> None:
        self._asks = False

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> Any:
        if name != "gymnasium" or self._asks:
            return None
        self._asks = True  # the finders after this one
        try:
            spec: Any = importlib.util.find_spec(name)
        finally:
            self._asks = False
        if spec is not None:
            spec.loader.exec_module = self._then_registers(spec.loader.exec_module)
        return spec

    def _then_registers(self, execute: Callable[[Any], None]) -> Callable[[Any], None]:
        def both(module: Any) -> None:
            execute(module)
            sys.meta_path.remove(self)
            register()

        return both
