"""`Trainer`: the same runs for people who come from Stable-Baselines3."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from detpg.runs import RunDirectoryError, numbered, plain, read_arrays, typed, write_arrays
from detpg.types import Policy, hyper_parameters, switches
from detpg.workbench.config import Config
from detpg.workbench.diagnosis import ended
from detpg.workbench.engines import engine_of
from detpg.workbench.learners import algorithm_class, learner
from detpg.workbench.own import check_imported, import_module_of
from detpg.workbench.session import Interval, Session
from detpg.workbench.sizes import check_memory

CONFIG, STEP, RESERVED = "config", "step", "reserved"
OF_FOLDERS = ("steps", "checkpoint_every", "keep_checkpoints")
OWN = "own"  # the kind of a policy that was given as an object


class Trainer:
    """An algorithm in a world, in memory: `learn`, `predict`, `save`, `load`.

        trainer = detpg.Trainer("copdac-q", "Pendulum-v1", alpha_theta=1e-3)
        trainer.learn(total_timesteps=100_000)
        action, _ = trainer.predict(observation)

    Attributes:
        config: Of the run.
        session: The learners, and all that belongs to them.
    """

    def __init__(
        self, algorithm: str, environment: Any, *, policy: Policy | str = "auto", **settings: Any
    ):
        """Builds the learner; nothing is learnt yet.

        Args:
            algorithm: Registry name, such as "copdac-q".
            environment: Registry name or Gymnasium id; an environment of `detpg.types` or its
                class; or a class or function that builds a `gymnasium.Env`. Those that build one
                are given `environment_options`.
            policy: One's own controller, or a kind: "mlp", "linear", "quadratic", "tiles".
            **settings: Hyper-parameters of the algorithm, and fields of `Config`.

        Raises:
            ValueError: What does not exist or does not fit, in one sentence.
        """
        kind = algorithm_class(algorithm)
        own = {*hyper_parameters(kind), *switches(kind)}
        options = {name: settings.pop(name) for name in list(settings) if name in own}
        # Of a run in a folder: what they are, or would be beside other settings, is of no weight.
        settings = {name: value for name, value in settings.items() if name not in OF_FOLDERS}
        named = isinstance(environment, str)
        if named:
            import_module_of(environment)
        self.config = Config.from_json(
            {
                "algorithm": algorithm,
                "environment": environment if named else _name(environment),
                "options": options,
                "policy": policy if isinstance(policy, str) else OWN,
                "steps": 1,  # `learn` says how many, and makes room for what is remembered
                **settings,
            }
        )
        engine = engine_of(self.config, None if named else environment)
        given = None if isinstance(policy, str) else policy
        self.session = Session(self.config, engine, learner(self.config, engine.spec, given))
        self._reserved = 0
        self._key = jax.random.fold_in(jax.random.key(self.config.seed), 2)

    @property
    def num_timesteps(self) -> int:
        """Steps taken so far, by each learner."""
        return self.session.step

    def learn(
        self, total_timesteps: int, callback: Callable[[Interval], Any] | None = None
    ) -> "Trainer":
        """Trains for that many further steps.

        Args:
            total_timesteps: Steps of each learner.
            callback: Called after every interval of `log_every` steps; False stops.

        Raises:
            DivergedError: No learner is finite any more.
            WorldError: The world raised, or returned what cannot be used: what was learnt before is
                there, and a further call goes on from it in new episodes.
            ValueError: No steps.
        """
        if total_timesteps < 1:
            raise ValueError(f"total_timesteps = {total_timesteps} is not usable: give 1 or more.")
        self.session.check_steps("total_timesteps", total_timesteps)
        until = self.session.step + total_timesteps
        self._reserve(until)
        while self.session.step < until:
            interval = self.session.advance(until)
            if len(interval.lost) == self.config.seeds:
                raise ended(interval.lost, self.session.engine.bounds)
            if callback is not None and callback(interval) is False:
                break
        return self

    def _reserve(self, steps: int) -> None:
        """Room for what will be remembered: nobody has said before how long it learns."""
        self._reserved = max(self._reserved, steps)
        config = dataclasses.replace(self.config, steps=self._reserved)
        taken = self.session.learner.experience
        if taken.kind == "recalled":
            check_memory(config, taken, self.session.engine.spec)
        self.session.reserve(self._reserved)

    def predict(
        self, observation: Any, deterministic: bool = True, seed: int = 0
    ) -> tuple[np.ndarray, None]:
        """The action in the world's units, shape (m,), or (N, m) for N observations.

        Args:
            observation: Shape (d,) or (N, d).
            deterministic: The mean action; else with the noise that it learns with.
            seed: Which of several learners.

        Raises:
            ValueError: An observation of another shape, or no such learner.
        """
        if not 0 <= seed < self.config.seeds:
            raise ValueError(f"seed = {seed} is not usable: give 0 to {self.config.seeds - 1}.")
        seen = jnp.asarray(observation, dtype=float)
        size = self.session.engine.spec.observation_size
        if seen.shape[-1:] != (size,) or seen.ndim > 2:
            raise ValueError(
                f"The observation has shape {seen.shape}: give ({size},) or (N, {size})."
            )
        controller = self.session.controller(self.session.learners, seed)
        self._key, key = jax.random.split(self._key)
        rows = jnp.atleast_2d(seen)
        if deterministic:
            actions = jax.vmap(controller)(rows)
        else:
            actions = jax.vmap(controller.explore)(jax.random.split(key, len(rows)), rows)
        return np.asarray(actions[0] if seen.ndim == 1 else actions), None

    def evaluate(self, episodes: int = 10) -> tuple[float, float]:
        """Mean and standard deviation of the return of the mean policy, over episodes.

        Raises:
            ValueError: No episodes, or no world to play them in.
        """
        if episodes < 1:
            raise ValueError(f"episodes = {episodes} is not usable: give 1 or more.")
        played = self.session.engine.play(self.session.learners, episodes, self.config.seed)
        if played is None:
            raise ValueError("There is no world to play in: the learner has logged data alone.")
        return float(played.returns.mean()), float(played.returns.std())

    def save(self, path: str | Path) -> None:
        """Writes all of it as one `.npz` file: to predict with, or to learn on."""
        about = {
            CONFIG: np.asarray(json.dumps(self.config.as_json())),
            STEP: self.session.step,
            RESERVED: self._reserved,
        }
        write_arrays(_npz(path), {**about, **numbered(self.session.kept)})

    @classmethod
    def load(
        cls, path: str | Path, environment: Any = None, policy: Policy | None = None
    ) -> "Trainer":
        """What `save` wrote.

        Args:
            path: The file.
            environment: Needed where it was given as an object.
            policy: One's own controller, where there was one; code is never loaded from a file.

        Raises:
            RunDirectoryError: The file is absent, damaged, or not of a trainer.
            ValueError: The environment or the policy does not fit.
        """
        kept = read_arrays(_npz(path)) or {}
        try:
            settings = {**json.loads(str(kept[CONFIG]))}
            name, world, kind = (settings.pop(x) for x in ("algorithm", "environment", "policy"))
            step, settings = int(kept[STEP]), _flat(settings)
        except (KeyError, TypeError, ValueError) as error:
            raise RunDirectoryError(f"{_npz(path)} is missing or no trainer's file.") from error
        if kind == OWN and policy is None:
            raise ValueError(
                f"{_npz(path)} was written by a trainer with a policy of your own: give it again, "
                "for code is never loaded from a file."
            )
        if environment is None:
            check_imported(world)
        given = kind if policy is None else policy
        trainer = cls(name, world if environment is None else environment, policy=given, **settings)
        if reserved := int(kept.get(RESERVED, 0)):
            trainer._reserve(reserved)
        session = trainer.session
        leaves, structure = jax.tree.flatten(session.kept)
        found = [kept.get(f"leaf{i}", np.empty(())) for i in range(len(leaves))]
        wanted = map(plain, leaves)
        if [(x.shape, x.dtype) for x in wanted] != [(x.shape, x.dtype) for x in found]:
            raise ValueError(
                f"{_npz(path)} was written by a learner of other sizes: give the environment and "
                "the policy that it was trained with."
            )
        session.resume(step, structure.unflatten(map(typed, found, leaves)))
        return trainer


def _name(environment: Any) -> str:
    """Of what is built or builds; it has no dot, colon or slash that means something."""
    return str(getattr(environment, "__name__", type(environment).__name__))


def _flat(settings: dict[str, Any]) -> dict[str, Any]:
    return {**settings, **settings.pop("options")}


def _npz(path: str | Path) -> Path:
    path = Path(path)
    return path if path.suffix == ".npz" else path.with_name(f"{path.name}.npz")
