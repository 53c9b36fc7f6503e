"""A run that was trained, opened again: its policies, and what they do."""

from pathlib import Path
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
import pyarrow as pa
from jaxtyping import PyTree

from detpg.integrations.gymnasium.filming import Film
from detpg.runs import RunDirectoryError, read_arrays
from detpg.types import Bounds, Environment, EnvironmentSpec, Policy
from detpg.workbench.config import Config
from detpg.workbench.engines import hosted_worlds, judging, own_world
from detpg.workbench.folder import found_config
from detpg.workbench.learners import learner
from detpg.workbench.own import needs_own, own_policy
from detpg.workbench.play import Played, finite_seeds
from detpg.workbench.run import BEST, LAST
from detpg.workbench.session import controller
from detpg.workbench.tables import evaluations_table
from detpg.world_error import WorldError
from detpg.wrappers import Controller

Which = Literal["best", "last"]
JUDGING = 3  # stream of the seed of `play`


class OpenedRun:
    """A run directory, read.

    Attributes:
        path: The directory.
        config: Of the run.
        spec: Of the world, actions in units of the box.
        bounds: Of the actions, in the world's own units.
        learner: The learner, as it was trained.
    """

    def __init__(self, path: Path, policy: Policy | str | None = None, world: Any = None):
        """Reads what the run is, none of its numbers yet.

        Args:
            path: The directory.
            policy: The user's own, or where it stands as FILE.py:NAME; code is never loaded from
                a run.
            world: The user's own, if it was given to `train_in`; built with the run's options.

        Raises:
            RunDirectoryError: No run, or one with a policy of the user's that is not given.
        """
        found = found_config(path)
        if found is None:
            raise RunDirectoryError(f"{path} is no run of `detpg train`: name its folder.")
        self.path, self._own = path, world
        try:
            self.config = Config.from_json(found["run"])
            self.spec, self.bounds = read_spec(found["spec"])
        except (TypeError, ValueError, KeyError) as error:
            raise RunDirectoryError(f"{path}/config.json is damaged ({error}).") from error
        if ".py:" in self.config.policy and policy is None:
            raise RunDirectoryError(needs_own(path, self.config))
        own = own_policy(policy, self.spec) if isinstance(policy, str) else policy
        self.learner = learner(self.config, self.spec, own)

    def learners(self, which: Which) -> PyTree:
        """States of the best or the last learners, seeds first.

        Raises:
            RunDirectoryError: They are not there yet, or damaged.
        """
        path = self.path / (BEST if which == "best" else LAST)
        kept = read_arrays(path)
        seeds = self.config.seeds
        like = jax.eval_shape(
            jax.vmap(self.learner.init), jax.random.split(jax.random.key(0), seeds)
        )
        leaves, structure = jax.tree.flatten(like)
        names = [f"leaf{i}" for i in range(len(leaves))]
        shapes = {"best_return": (seeds,)} | {n: leaf.shape for n, leaf in zip(names, leaves)}
        if kept is None or any(
            name not in kept or kept[name].shape != shape for name, shape in shapes.items()
        ):
            state = "damaged" if path.exists() else "not there yet: train on"
            raise RunDirectoryError(f"The {which} policy of {self.path} is {state}.")
        self._best_return = kept["best_return"]
        return structure.unflatten([jnp.asarray(kept[name]) for name in names])

    def index(self, which: Which = "best", seed: int | None = None) -> int:
        """The number of the learner that is shown: one's choice, or the best evaluated.

        Raises:
            RunDirectoryError: There is no such seed.
        """
        if seed is None:
            fine = finite_seeds(self.learners(which), self.config.seeds)
            known = np.flatnonzero(fine) if fine.any() else np.arange(self.config.seeds)
            return int(known[np.argmax(self._best_return[known])])
        if not 0 <= seed < self.config.seeds:
            raise RunDirectoryError(
                f"{self.path} has the seeds 0 to {self.config.seeds - 1}, not {seed}: give one of "
                "them."
            )
        return seed

    def controller(self, which: Which = "best", seed: int | None = None) -> Controller:
        """What is deployed."""
        number = self.index(which, seed)
        state = jax.tree.map(lambda leaf: leaf[number], self.learners(which))
        return controller(self.learner, state, self.bounds)

    def play(self, which: Which = "best", episodes: int = 100, seed: int = 0) -> pa.Table:
        """Episodes of all learners' mean policies: columns seed, episode, return, length.

        Raises:
            RunDirectoryError: There is no world to play in.
        """
        if self.config.environment is None:
            raise RunDirectoryError(
                f"{self.path} was trained on logged data alone, and there is no world to play in: "
                "train with the name of one beside the data."
            )
        # The data are not needed any more, and may be elsewhere.
        engine = judging(self.config, self._own)
        try:
            engine.use(self.learner)
            # Other episodes than those by which the best policies were chosen.
            own = int(np.random.SeedSequence([seed, JUDGING]).generate_state(1)[0]) >> 1
            played: Played | None = engine.play(self.learners(which), episodes, own)
        finally:
            engine.close()
        assert played is not None  # in a world
        # When the best were learnt differs from seed to seed, and a run may have stopped early.
        return evaluations_table(played, self.config.steps).drop_columns(["step"])

    @property
    def world(self) -> Environment | None:
        """The environment of `detpg.environments` that it was trained in; None: another one."""
        return own_world(self.config)

    def film(self, which: Which, seed: int | None, start: int, max_steps: int) -> Film:
        """Frames of an episode in a Gymnasium environment, the start's first.

        Args:
            which: The best policies or the last.
            seed: Of the learner; the best evaluated when not given.
            start: Seed of the episode.
            max_steps: Steps after which the film ends.

        Raises:
            ValueError: The environment draws nothing, or what no film can be made of.
        """
        if self.config.environment is None:
            raise RunDirectoryError(f"{self.path} knows logged data alone: nothing can be filmed.")
        controller = self.controller(which, seed)
        act = jax.jit(lambda observation: controller(observation))
        worlds = hosted_worlds(self.config, self._own, 1, render_mode="rgb_array")
        try:
            observation = worlds.reset([start])
            film = Film(worlds.spec.name, worlds.frame_rate)
            film.add(worlds.render())
            for t in range(1, max_steps + 1):
                try:
                    step = worlds.step(np.asarray(act(observation[0]))[None])
                except WorldError as error:
                    error.when = f"at step {t:,} of the film"
                    raise
                observation = step.observation
                over = bool(step.terminated[0] | step.truncated[0])
                # The world stands in its next episode by then: its last picture is lost.
                if over:
                    break
                film.add(worlds.render())
            return film
        finally:
            worlds.close()


def open_run(path: Path | str, policy: Policy | str | None = None, world: Any = None) -> OpenedRun:
    """A run directory, read; see `OpenedRun`."""
    return OpenedRun(Path(path), policy, world)


def read_spec(found: dict[str, Any]) -> tuple[EnvironmentSpec, Bounds]:
    """What `run.spec_json` wrote: the spec with actions in units of the box, and the box."""

    def ends(name: str) -> tuple[float, ...]:
        return tuple(float(x) for x in found[name])

    bounds = Bounds(ends("action_low"), ends("action_high"))
    spec = EnvironmentSpec(
        name=str(found["name"]),
        observation_size=int(found["observation_size"]),
        action_size=int(found["action_size"]),
        action_low=bounds.scaled.low,
        action_high=bounds.scaled.high,
        time_limit=int(found["time_limit"]),
        discount=float(found["discount"]),
        observation_low=ends("observation_low"),
        observation_high=ends("observation_high"),
    )
    return spec, bounds
