"""What a run is: every choice as plain data, so that it can stand in a file."""

import dataclasses
import json
import tomllib
from pathlib import Path
from typing import Any, Literal, get_args

from detpg.workbench.defaults import defaults_of

SETTINGS = Path(__file__).parent / "settings"
TUNED = "tuned"  # instead of a file: what is known of the environment

PolicyKind = str  # "auto", "mlp", "linear", "tiles", "quadratic" or "FILE.py:NAME"
ValueKind = Literal["mlp", "quadratic", "tiles"]
Norm = Literal["none", "first", "all"]
Normalise = Literal["none", "observations", "rewards", "both"]


@dataclasses.dataclass(frozen=True)
class Config:
    """A run of one algorithm in one world, or on one data set.

    Attributes:
        algorithm: Registry name.
        environment: Registry name or Gymnasium id.
        data: Parquet or Minari data set to learn from instead.
        environment_options: Keyword arguments of the environment.
        options: Hyper-parameters and switches of the algorithm that are not its defaults.
        policy: Kind of mu_theta.
        hidden: Units of each hidden layer of a network.
        value: Kind of the critic's function.
        value_units: Hidden units of a critic that is a network.
        norm: LayerNorm of critics that recall: none, after the first layer, or in all.
        tiles: Tiles along each dimension of tile-coded parts.
        tilings: Tilings of tile-coded parts.
        hashed: Weights that the tiles of each such part share; none: each tile has its own.
        normalise: What is normalised.
        steps: Environment steps of each learner.
        seeds: Learners side by side, each with a seed of its own.
        seed: Of everything random.
        num_envs: Worlds for each learner; more than one only where the host steps them.
        time_limit: Steps after which an episode is cut; none: the world's own.
        log_every: Steps between rows of the metrics.
        evaluate_every: Steps between evaluations, a multiple of `log_every`.
        evaluation_episodes: Of each evaluation; 0: nothing is judged, and the last policy is the
            best.
        judge_in_same_world: Whether evaluations are played in the worlds that train, which begin
            new episodes afterwards; of no weight where the world is compiled.
        checkpoint_every: Steps between checkpoints, a multiple of `log_every`.
        keep_checkpoints: How many are kept.
    """

    algorithm: str
    environment: str | None = None
    data: str | None = None
    environment_options: dict[str, Any] = dataclasses.field(default_factory=dict)
    options: dict[str, Any] = dataclasses.field(default_factory=dict)
    policy: PolicyKind = "auto"
    hidden: tuple[int, ...] = (32,)
    value: ValueKind = "mlp"
    value_units: int = 40
    norm: Norm = "first"
    tiles: int = 8
    tilings: int = 8
    hashed: int | None = None
    normalise: Normalise = "observations"
    steps: int = 100_000
    seeds: int = 1
    seed: int = 0
    num_envs: int = 1
    time_limit: int | None = None
    log_every: int = 1_000
    evaluate_every: int = 5_000
    evaluation_episodes: int = 10
    judge_in_same_world: bool = False
    checkpoint_every: int = 5_000
    keep_checkpoints: int = 3

    def __post_init__(self):
        _check(self)

    @property
    def identity(self) -> dict[str, Any]:
        """What makes it this run and no other: all but its length and its bookkeeping."""
        free = ("steps", "keep_checkpoints", "checkpoint_every")
        return {name: value for name, value in self.as_json().items() if name not in free}

    def as_json(self) -> dict[str, Any]:
        """As JSON types.

        Raises:
            ValueError: An option of the environment that is none.
        """
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return json.loads(json.dumps(fields, default=_plain))

    @classmethod
    def from_json(cls, found: dict[str, Any]) -> "Config":
        """What `as_json` gave, or settings that somebody chose: the others follow from them.

        Raises:
            ValueError: An unknown key.
        """
        known = {field.name for field in dataclasses.fields(cls)}
        unknown = [name for name in found if name not in known]
        if unknown:
            raise ValueError(f"{unknown[0]!r} is no setting of a run: leave it out.")
        found = defaults_of(found.get("algorithm")) | found
        units = found.get("hidden", cls.hidden)
        hidden = tuple(units) if isinstance(units, list | tuple) else (units,)
        return cls(**{**fitting(found), "hidden": hidden})


def _plain(value: Any) -> Any:
    """NumPy's numbers and arrays as Python's."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise ValueError(
        f"The option {value!r} cannot be kept in a file: give numbers, words, lists or tables, or "
        "a function that builds the environment with it."
    )


CHOICES = {
    "value": get_args(ValueKind),
    "norm": get_args(Norm),
    "normalise": get_args(Normalise),
}
POSITIVE = (
    "steps",
    "seeds",
    "num_envs",
    "value_units",
    "tiles",
    "tilings",
    "log_every",
    "evaluate_every",
    "checkpoint_every",
    "keep_checkpoints",
)
# May be none; and what the sizes of tile-coded parts are made of.
OPTIONAL, TILES = ("time_limit", "hashed"), ("tiles", "tilings", "hashed")
LONGEST_ROW = 1_000_000  # steps
# Setting -> of what it must be a multiple.
MULTIPLES = {
    "log_every": "num_envs",
    "evaluate_every": "log_every",
    "checkpoint_every": "log_every",
}


def fitting(found: dict[str, Any]) -> dict[str, Any]:
    """With defaults that nobody named raised to the next multiple of what was named."""
    full: dict[str, Any] = {f.name: f.default for f in dataclasses.fields(Config)} | found
    for name, unit in {**MULTIPLES, "steps": "num_envs"}.items():
        whole = isinstance(full[unit], int) and full[unit] > 0
        if name not in found and whole and full[name] % full[unit]:
            found = {**found, name: -(-full[name] // full[unit]) * full[unit]}
            full |= found
    return found


def _check(config: Config) -> None:
    """Refuses numbers that cannot be.

    Raises:
        ValueError: Names the setting, its value and what would do.
    """
    _check_kinds(config)
    for name in POSITIVE:
        if getattr(config, name) < 1:
            raise ValueError(f"{name} = {getattr(config, name)} is not usable: give 1 or more.")
    if config.evaluation_episodes < 0:
        raise ValueError(
            f"evaluation_episodes = {config.evaluation_episodes} is not usable: give 1 or more, or "
            "0 for no evaluations."
        )
    if not config.hidden or min(config.hidden) < 1:
        raise ValueError(f"hidden = {config.hidden} is not usable: give 1 or more for each layer.")
    if not 0 <= config.seed < 2**31:
        raise ValueError(f"seed = {config.seed} is not usable: give 0 to {2**31 - 1}.")
    for name in ("steps", "time_limit"):
        if (getattr(config, name) or 0) >= 2**31:
            raise ValueError(
                f"{name} = {getattr(config, name)} is not usable: give less than 2^31, the steps "
                "that a run can count."
            )
    if config.log_every > LONGEST_ROW:
        raise ValueError(
            f"log_every = {config.log_every} is not usable: give at most {LONGEST_ROW}, since the "
            "sums of a row are of single precision."
        )
    for name in OPTIONAL:
        value = getattr(config, name)
        if value is not None and value < 1:
            raise ValueError(f"{name} = {value} is not usable: give 1 or more.")
    sizes = [(name, getattr(config, name) or 1) for name in ("value_units", *TILES)]
    for name, value in [*sizes, *(("hidden", units) for units in config.hidden)]:
        if value >= 2**31:
            raise ValueError(f"{name} = {value} is not usable: give less than 2^31.")
    for name, unit in MULTIPLES.items():
        if getattr(config, name) % getattr(config, unit):
            raise ValueError(
                f"{name} = {getattr(config, name)} is no multiple of {unit} = "
                f"{getattr(config, unit)}: give one that is."
            )
    if config.environment is None and config.data is None:
        raise ValueError("There is nothing to learn from: name an environment, or give data.")


def _check_kinds(config: Config) -> None:
    """Refuses what a file can hold but no setting is."""
    names = *POSITIVE, *OPTIONAL, "seed", "evaluation_episodes"
    whole = [(name, getattr(config, name)) for name in names]
    for name, value in [*whole, *(("hidden", units) for units in config.hidden)]:
        if name in OPTIONAL and value is None:
            continue
        if not isinstance(value, int) or isinstance(value, bool):
            raise ValueError(f"{name} = {value!r} is no whole number: give one, such as 1000.")
    if not isinstance(config.judge_in_same_world, bool):
        raise ValueError(
            f"judge_in_same_world = {config.judge_in_same_world!r} is no yes or no: give true or "
            "false."
        )
    for name, known in CHOICES.items():
        if getattr(config, name) not in known:
            raise ValueError(
                f"{name} = {getattr(config, name)!r} is unknown: choose one of {', '.join(known)}."
            )
    for name in ("algorithm", "environment", "data", "policy"):
        if not isinstance(getattr(config, name), str | None):
            raise ValueError(f"{name} = {getattr(config, name)!r} is no name: give text.")
    for name in ("options", "environment_options"):
        if not isinstance(getattr(config, name), dict):
            raise ValueError(f"{name} = {getattr(config, name)!r} is no table of names and values.")


def tuned(environment: str | None) -> tuple[Path | None, list[str]]:
    """The file of settings with which learners learn an environment, and which learners do."""
    found = SETTINGS / f"{environment}.toml"
    if not found.is_file():
        return None, []
    return found, list(tomllib.loads(found.read_text()))


def read_settings(path: Path, algorithm: str) -> dict[str, Any]:
    """Settings from a TOML or JSON file: flat, in a table of the algorithm's name, or a run's own.

    Raises:
        ValueError: A file that cannot be read, in one sentence.
    """
    try:
        text = path.read_text()
        found = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except OSError as error:
        raise ValueError(f"{path} cannot be read ({error.strerror}).") from error
    except ValueError as error:
        raise ValueError(
            f"{path} cannot be read ({error}): give TOML, or JSON in a file .json."
        ) from error
    found = (
        found.get("run", found) if isinstance(found, dict) else found
    )  # of a run's `config.json`
    if not isinstance(found, dict):
        raise ValueError(f"{path} holds no settings: give `name = value` lines.")
    tables = {name: value for name, value in found.items() if isinstance(value, dict)}
    own = tables.pop(algorithm, {})
    flat = {n: v for n, v in found.items() if not isinstance(v, dict)} | own
    for name in ("options", "environment_options"):
        flat |= {name: tables[name]} if name in tables else {}
    return flat
