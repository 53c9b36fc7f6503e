"""detpg: deterministic policy gradients, from the theorem to the robot.

The folders are stops on the road of the data, and imports follow it:

    environments   p_1, p and r: what the world does with an action
    policies       mu_theta, pi_{theta,y}, and the behaviour beta
    features       phi(s, a): what the critic is linear in
    critics        estimates of Q and V
    actors         ascent directions
    algorithms     the paper's boxes, where the four stops above meet
    training       the one loop over time
    kernels        the same for tile-coded learners, compiled
    evaluation     greedy returns, intervals
    experiments    studies as data, sweeps, claims
    theorems       beside it: the paper's theorems as checks
    figures        tables drawn

`detpg.wrappers` goes around an algorithm: normalisers, meters, what is deployed.
`detpg.replaying` is the same loop over logged transitions of another behaviour.
`detpg.diagnostics` measures one's own critic against Theorem 3, and one's own actor's direction
against the exact gradient.
`detpg.workbench` trains on one's own problem: a Gymnasium environment, a controller, logged data.
`detpg.integrations` shows the environments to other libraries, and theirs to the learners.
`detpg.testing` checks one's own environments and algorithms against the protocols of `detpg.types`.
"""

import importlib
from typing import TYPE_CHECKING, Any

from detpg.integrations.registration import register_when_imported
from detpg.version import __version__ as __version__

if TYPE_CHECKING:
    from detpg.algorithms import ALGORITHMS
    from detpg.environments import ENVIRONMENTS
    from detpg.evaluation import greedy_return
    from detpg.training import TrainState, begin, train
    from detpg.types import EnvironmentSpec, Transition
    from detpg.workbench import Trainer

__all__ = [
    "ALGORITHMS",
    "ENVIRONMENTS",
    "EnvironmentSpec",
    "TrainState",
    "Trainer",
    "Transition",
    "begin",
    "greedy_return",
    "train",
]

_HOMES = {
    "ALGORITHMS": "detpg.algorithms",
    "ENVIRONMENTS": "detpg.environments",
    "EnvironmentSpec": "detpg.types",
    "TrainState": "detpg.training",
    "Trainer": "detpg.workbench",
    "Transition": "detpg.types",
    "begin": "detpg.training",
    "greedy_return": "detpg.evaluation",
    "train": "detpg.training",
}

register_when_imported()


def __getattr__(name: str) -> Any:
    """Imports a public name when it is first used: `detpg --help` must not wait for JAX."""
    if name not in _HOMES:
        raise AttributeError(f"module 'detpg' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)
