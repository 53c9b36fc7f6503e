"""From names to a learner: policy, critic, normalisers, meter."""

import dataclasses
import typing
from typing import Any

import numpy as np

from detpg.algorithms import ALGORITHMS, DDPG
from detpg.algorithms.parts import check_moves, network
from detpg.critics import (
    EnsembleActionValues,
    LinearStateValue,
    MLPActionValue,
    MLPStateValue,
    QuadraticActionValue,
    QuadraticStateValue,
)
from detpg.features import TileCoding
from detpg.features.quadratic import QuadraticFeatures
from detpg.policies import FeaturePolicy, LinearPolicy, NetworkPolicy
from detpg.types import (
    ActionValues,
    Algorithm,
    EnvironmentSpec,
    Features,
    Policy,
    hyper_parameters,
    switches,
)
from detpg.workbench.config import Config
from detpg.workbench.sizes import check_memory, check_size, check_tiles
from detpg.wrappers import Metered, Normalised

SPREAD = 3.0  # standard deviations that tiles cover, where observations are normalised
PARTS = ("policy", "action_value", "action_values", "state_value", "features")
KINDS = ("mlp", "linear", "tiles", "quadratic")


def algorithm_class(name: str) -> type[Algorithm]:
    """The algorithm of a registry name.

    Raises:
        ValueError: There is none; names those there are.
    """
    if name not in ALGORITHMS:
        raise ValueError(f"algorithm {name!r} is unknown: choose one of {', '.join(ALGORITHMS)}.")
    return ALGORITHMS[name]


def check_episodes(learner: Algorithm, spec: EnvironmentSpec) -> None:
    """Refuses a learner of one-step episodes in a world of longer ones.

    Raises:
        ValueError: Says what it takes.
    """
    if learner.experience.kind == "fresh" and spec.time_limit != 1:
        raise ValueError(
            f"The learner takes batches of {learner.experience.batch} one-step episodes of a "
            f"bandit, but {spec.name!r} is a world of steps: choose another algorithm."
        )


def parts_of(algorithm: type[Algorithm]) -> tuple[str, ...]:
    """Which parts it is made of, among `PARTS`."""
    names = [field.name for field in dataclasses.fields(typing.cast("Any", algorithm))]
    return tuple(n for n in PARTS if n in names)


def learner(config: Config, spec: EnvironmentSpec, own: Policy | None = None) -> Algorithm:
    """The learner of a run, as the loop drives it: normalised and metered where it can be.

    Args:
        config: Of the run.
        spec: Of the world, actions in units of its box.
        own: The user's policy, where the configuration names one.

    Raises:
        ValueError: An option, a part or a number that does not fit; says what would.
    """
    inner = bare(config, spec, own)
    if inner.experience.kind == "fresh":
        return inner
    observations = config.normalise in ("observations", "both")
    rewards = config.normalise in ("rewards", "both")
    if observations or rewards:
        gamma = getattr(inner, "gamma")  # noqa: B009  (not of the protocol; every such learner has it)
        inner = Normalised.create(
            spec, algorithm=inner, observations=observations, rewards=rewards, gamma=gamma
        )
    return Metered.create(spec, algorithm=inner)


def bare(config: Config, spec: EnvironmentSpec, own: Policy | None) -> Algorithm:
    """The algorithm itself, with its parts."""
    kind = algorithm_class(config.algorithm)
    _check_options(kind, config)
    parts: dict[str, Any] = {}
    needed = parts_of(kind)
    if kind.__name__.startswith("Bandit"):
        if config.policy != "auto":
            raise ValueError(f"{config.algorithm} has a policy of its own: leave policy out.")
        return kind.create(spec, **config.options)
    if "policy" in needed:
        recalls = "action_values" in needed
        parts["policy"] = _policy(config, spec, recalls) if own is None else own
    if "action_value" in needed:
        parts["action_value"] = _action_value(config, spec)
    if "action_values" in needed:
        parts["action_values"] = _action_values(config, spec, kind)
    if "state_value" in needed:
        parts["state_value"] = _state_value(config, spec)
    if "features" in needed:
        parts["features"] = _features(config, spec, own)
    check_size(config, parts)
    made = kind.create(spec, **parts, **config.options)
    check_size(config, parts, made)
    if made.experience.kind == "recalled":
        check_memory(config, made.experience, spec)
    elif config.data is None:
        _check_noise(config.algorithm, made, spec)
    return made


def _check_noise(name: str, made: Any, spec: EnvironmentSpec) -> None:
    """Refuses a learner without noise that learns nothing from its own actions."""
    if parts_of(type(made))[0] != "policy" or np.any(np.asarray(getattr(made, "sigma", 1.0))):
        return
    if hasattr(made, "action_value"):
        check_moves(spec, {"policy": made.policy, "action_value": made.action_value})
    elif not made.capped:
        raise ValueError(
            f"sigma = 0 leaves {name} nothing to learn from, since phi(s, a) is 0 at its own "
            "actions: give sigma > 0, or data."
        )


def _check_options(kind: type[Algorithm], config: Config) -> None:
    known = [*hyper_parameters(kind), *switches(kind)]
    for name in config.options:
        if name not in known:
            raise ValueError(
                f"{name} is no option of {config.algorithm}: choose from {', '.join(known)}."
            )


def _policy(config: Config, spec: EnvironmentSpec, recalls: bool) -> Policy:
    d, m = spec.observation_size, spec.action_size
    if config.policy in ("auto", "mlp"):
        plain = network(spec, config.hidden)
        output = "tanh" if plain.output == "tanh" else "linear"
        return NetworkPolicy(d, m, config.hidden, output=output) if recalls else plain
    if config.policy == "linear":
        return LinearPolicy(d, m)
    if config.policy == "quadratic":
        return FeaturePolicy(QuadraticFeatures(d), m)
    if config.policy == "tiles":
        return FeaturePolicy(_tiles(config, spec), m)
    raise ValueError(
        f"policy {config.policy!r} is unknown: choose one of {', '.join(KINDS)}, or FILE.py:NAME."
    )


def _action_value(config: Config, spec: EnvironmentSpec) -> Any:
    d, m = spec.observation_size, spec.action_size
    if config.value == "mlp":
        return MLPActionValue(d, m, config.value_units)
    if config.value == "quadratic":
        return QuadraticActionValue(d, m)
    raise ValueError(
        f"value {config.value!r} is no kind of Q(s, a) for {config.algorithm}: choose mlp or "
        "quadratic."
    )


def _action_values(config: Config, spec: EnvironmentSpec, kind: type[Algorithm]) -> ActionValues:
    if config.value != "mlp":
        raise ValueError(f"value {config.value!r} does not fit {config.algorithm}: choose mlp.")
    sizes = spec.observation_size, spec.action_size
    return EnsembleActionValues(*sizes, config.hidden, config.norm, size=1 if kind is DDPG else 2)


def _state_value(config: Config, spec: EnvironmentSpec) -> Any:
    if config.value == "mlp":
        return MLPStateValue(spec.observation_size, config.value_units)
    if config.value == "quadratic":
        return QuadraticStateValue(spec.observation_size)
    return LinearStateValue(_tiles(config, spec))


def _features(config: Config, spec: EnvironmentSpec, own: Policy | None) -> Features:
    if own is not None or config.policy not in ("auto", "quadratic", "tiles"):
        raise ValueError(
            f"{config.algorithm} has a Gaussian policy that is linear in features, so policy "
            f"{config.policy!r} does not fit: choose quadratic or tiles."
        )
    tiles = config.policy == "tiles"
    return _tiles(config, spec) if tiles else QuadraticFeatures(spec.observation_size)


def _tiles(config: Config, spec: EnvironmentSpec) -> TileCoding:
    """Over the bounds of the observation, or what is usual where it is normalised."""
    size = spec.observation_size
    check_tiles(config, size)
    grid, options = (config.tiles,) * size, {"num_tilings": config.tilings, "memory": config.hashed}
    if config.normalise in ("observations", "both"):
        return TileCoding((-SPREAD,) * size, (SPREAD,) * size, grid, **options)
    return TileCoding.for_environment(spec, tiles=grid, **options)
