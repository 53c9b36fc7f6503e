"""Learners on logged data: nothing is acted, and a world, if there is one, only judges."""

import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
from jaxtyping import PyTree

from detpg.integrations.logged import Logged, read
from detpg.replaying import ReplayState, check_learner, learn_from
from detpg.types import Algorithm, Bounds
from detpg.workbench.compiled import learner_keys
from detpg.workbench.config import Config
from detpg.workbench.play import Played
from detpg.workbench.session import Engine

DISCOUNT = 0.99  # where neither a world nor the user says


class Replayed:
    """The engine of a data set.

    Attributes:
        spec: What a learner must know, actions in units of the box.
        bounds: Of the actions, in the data's units.
        exact: Whether a resumed run equals one that was never stopped.
        resume_note: What a user is told about resuming.
    """

    exact = True
    resume_note = "a resumed run is equal to the bit to one that was never stopped"

    def __init__(self, config: Config, world: Engine | None):
        """Reads the data.

        Args:
            config: Of the run.
            world: Where evaluations are played; none are without.

        Raises:
            ValueError: Data that cannot be read, or that are not of that world.
        """
        self._config, self._world = config, world
        self._data: Logged = read(str(config.data), None if world is None else world.bounds)
        self.bounds: Bounds = self._data.bounds
        self.spec = self._data.spec(DISCOUNT) if world is None else world.spec
        own = self._data.observation.shape[1], self._data.action.shape[1]
        needed = self.spec.observation_size, self.spec.action_size
        if own != needed:
            raise ValueError(
                f"{config.data} has {own[0]} numbers in an observation and {own[1]} in an action, "
                f"but {self.spec.name!r} has {needed[0]} and {needed[1]}: give data of that world."
            )

    def use(self, learner: Algorithm) -> None:
        """The learner that is driven.

        Raises:
            ValueError: One that such data would mislead.
        """
        check_learner(learner)
        self.learner = learner
        if self._world is not None:
            self._world.use(learner)
        self._keys = learner_keys(self._config)

    def begin(self) -> ReplayState:
        """Before the first step."""

        def one(key: Any) -> ReplayState:
            learner = self.learner.init(jax.random.split(key, 3)[2])  # as `learn_from` begins
            return ReplayState(learner, jax.numpy.asarray(0, dtype=int))

        return jax.jit(jax.vmap(one))(self._keys)

    def resume(self, state: ReplayState, step: int) -> ReplayState:
        """All of it was kept."""
        return state

    def advance(self, state: ReplayState, steps: int) -> ReplayState:
        """That many transitions on."""
        return self._program(steps)(self.learner, self._data, self._keys, state)

    @functools.lru_cache(maxsize=4)  # noqa: B019  (an engine lives as long as its run)
    def _program(self, steps: int) -> Callable[..., ReplayState]:
        def one(learner: Algorithm, data: Logged, key: Any, state: ReplayState) -> ReplayState:
            return learn_from(learner, data, key, steps, state)[0]

        return jax.jit(jax.vmap(one, in_axes=(None, None, 0, 0)))

    def learners(self, state: ReplayState) -> PyTree:
        """States of the learners, seeds first."""
        return state.learner

    def metered(self, state: ReplayState) -> PyTree:
        """The same."""
        return state.learner

    def with_learners(self, state: ReplayState, learners: PyTree) -> ReplayState:
        """With other states of the learners."""
        return eqx.tree_at(lambda tree: tree.learner, state, learners)

    def play(self, learners: PyTree, episodes: int, seed: int) -> Played | None:
        """Episodes in the world, if there is one."""
        return None if self._world is None else self._world.play(learners, episodes, seed)

    def close(self) -> None:
        """Closes the world."""
        if self._world is not None:
            self._world.close()
