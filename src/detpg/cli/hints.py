"""Commands that are named to a user: as they can be typed, and only those that work."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from detpg.workbench.config import Config


def typed(command: str, *words: Any) -> str:
    """A command of detpg with its words, quoted for a shell."""
    # A folder whose name begins with a dash would be taken for a flag.
    named = (f"./{w}" if isinstance(w, Path) and str(w)[0] == "-" else str(w) for w in words)
    return shlex.join(["detpg", command, *named])


def own_world(config: "Config") -> list[str]:
    """What names the run's environment again, where it is one of the user's own."""
    own = ":" in str(config.environment)
    return ["--own-environment", str(config.environment)] if own else []


def own_policy(config: "Config", given: str | None = None) -> list[str]:
    """What names the run's policy again, where it is one of the user's own.

    Args:
        config: Of the run.
        given: Where it stood this time; where it stood in training when not given.
    """
    own = ".py:" in config.policy
    return ["--own-policy", given or config.policy] if own else []


def resume(path: Path, config: "Config", given: str | None = None) -> str:
    """What continues a run."""
    return typed("resume", path, *own_policy(config, given), *own_world(config))


def after(path: Path, config: "Config", given: str | None) -> dict[str, str]:
    """What can be done with a run that has ended; an aim -> a command."""
    from detpg.integrations.export import has_onnx

    policy, world = own_policy(config, given), own_world(config)
    # Without a world, or with no episode of an evaluation, there are no returns.
    returns = config.environment and config.evaluation_episodes
    metric = [] if returns else ["--metric", "train/td_error"]
    judged = {"judge": typed("evaluate", path, *policy, *world)} if config.environment else {}
    kind = "onnx" if has_onnx() else "jax"
    return {
        "look": typed("plot", path, *metric),
        **judged,
        "use": typed("export", path, "--format", kind, *policy),
    }
