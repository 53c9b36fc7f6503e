"""Learners in a world that JAX compiles: all seeds in one program, resumed to the bit."""

import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Key, PyTree

from detpg.environments import ENVIRONMENTS, ScaledActions, TimeLimited
from detpg.training import TrainState, begin, train
from detpg.types import Algorithm, Bounds, Environment, EnvironmentSpec
from detpg.workbench.config import Config
from detpg.workbench.lanes import each, joined, lane
from detpg.workbench.learners import check_episodes
from detpg.workbench.play import Played, episode, without_lost

LEARNING, EVALUATION = 0, 1  # streams of the run's seed
HOST_SEEDS = 2**31 - 2**20


class Compiled:
    """The engine of a world of `detpg.environments`.

    Attributes:
        world: With actions in its own units.
        spec: Of the same world, actions in units of the box.
        bounds: Of the actions, in the world's own units.
        exact: Whether a resumed run equals one that was never stopped.
        resume_note: What a user is told about resuming.
        reached: Where an interval that was broken off stood, and the steps that led there.
    """

    exact = True
    resume_note = "a resumed run is equal to the bit to one that was never stopped"

    def __init__(self, config: Config, environment: Environment):
        """Wraps a world; compiles nothing yet."""
        self.world, self._config = environment, config
        self.reached: tuple[TrainState, int] | None = None
        limit = config.time_limit or environment.spec.time_limit
        self._environment = ScaledActions(TimeLimited(environment, limit))
        self.spec: EnvironmentSpec = self._environment.spec
        self.bounds: Bounds = environment.spec.bounds
        if config.num_envs != 1:
            raise ValueError(
                f"num_envs = {config.num_envs} is not usable with {self.spec.name!r}, which is "
                "compiled whole: leave it out and give more seeds."
            )

    def use(self, learner: Algorithm) -> None:
        """The learner that is driven.

        Raises:
            ValueError: It learns from batches of one-step episodes, and this world has longer ones.
        """
        check_episodes(learner, self.spec)
        self.learner = learner
        self._keys = learner_keys(self._config)

    def begin(self) -> TrainState:
        """Before the first step."""
        keys = jax.vmap(lambda key: jax.random.split(key)[1])(self._keys)

        @jax.jit
        def one(key: Any) -> TrainState:
            return begin(self.learner, self._environment, key, self._config.steps)

        if self.learner.experience.kind == "recalled":
            return joined([one(key) for key in keys])
        return jax.vmap(one)(keys)

    def resume(self, state: TrainState, step: int) -> TrainState:
        """All of it was kept."""
        return state

    def advance(self, state: TrainState, steps: int) -> TrainState:
        """That many steps on."""
        if self.learner.experience.kind == "recalled":
            return self._advance_apart(state, steps)
        return self._program(steps)(self.learner, self._keys, state)

    def _advance_apart(self, state: TrainState, steps: int) -> TrainState:
        run, done, self.reached = self._alone(steps), {}, None

        def one(i: int) -> TrainState:
            done[i] = run(self.learner, self._keys[i], lane(state, i))
            return done[i]

        num = len(self._keys)
        try:
            return joined(each(one, num))
        except BaseException:  # Ctrl-C: what a memory was given away for must not be lost
            if len(done) == num:
                self.reached = joined([done[i] for i in range(num)]), steps
            raise

    def learners(self, state: TrainState) -> PyTree:
        """States of the learners, seeds first."""
        return state.learner

    def metered(self, state: TrainState) -> PyTree:
        """The same; each learner lives in one world."""
        return state.learner

    def with_learners(self, state: TrainState, learners: PyTree) -> TrainState:
        """With other states of the learners."""
        return eqx.tree_at(lambda tree: tree.learner, state, learners)

    def play(self, learners: PyTree, episodes: int, seed: int) -> Played:
        """Episodes of the mean policies; their seeds are no learner's."""
        root = jax.random.fold_in(jax.random.key(seed), EVALUATION)
        keys = jax.random.split(root, episodes)
        found = self._player(self.learner, keys, learners)
        return without_lost(Played(*map(np.asarray, found)), learners)

    @functools.cached_property
    def _player(self) -> Callable[..., Any]:
        def one(learner: Algorithm, key: Any, state: PyTree) -> Any:
            return episode(learner, self._environment, key, state)

        each = jax.vmap(one, in_axes=(None, 0, None))
        return jax.jit(jax.vmap(each, in_axes=(None, None, 0)))

    @functools.lru_cache(maxsize=4)  # noqa: B019  (an engine lives as long as its run)
    def _program(self, steps: int) -> Callable[..., TrainState]:
        return jax.jit(jax.vmap(self._one(steps), in_axes=(None, 0, 0)))

    @functools.lru_cache(maxsize=4)  # noqa: B019  (likewise)
    def _alone(self, steps: int) -> Callable[..., TrainState]:
        return jax.jit(self._one(steps), donate_argnums=2)

    def _one(self, steps: int) -> Callable[..., TrainState]:
        # The learner is an argument: other step sizes find the program that was compiled for these.
        def one(learner: Algorithm, key: Any, state: TrainState) -> TrainState:
            return train(learner, self._environment, key, steps, start=state)[0]

        return one

    def close(self) -> None:
        """Nothing is open."""


def learner_keys(config: Config) -> Key[jax.Array, "seeds"]:
    """A key for each learner; the same in every kind of world."""
    root = jax.random.fold_in(jax.random.key(config.seed), LEARNING)
    return jax.vmap(functools.partial(jax.random.fold_in, root))(np.arange(config.seeds))


def host_seed(*words: int) -> int:
    """A seed for a world of the host; with a million counted on from it, it fits in 31 bits."""
    return int(np.random.SeedSequence(words).generate_state(1)[0]) % HOST_SEEDS


def named(config: Config, name: str) -> Environment:
    """The registered environment of a name, with the options of a configuration.

    Raises:
        ValueError: An option that it does not take.
    """
    options = dict(config.environment_options)
    if name == "bandit":
        options.setdefault("key", jax.random.key(config.seed))
    return built(ENVIRONMENTS[name], name, options)


def built(kind: Any, name: str, options: dict[str, Any]) -> Environment:
    """An environment from its class.

    Raises:
        ValueError: An option that it does not take, or lacks.
    """
    try:
        return kind(**options)
    except TypeError as error:
        raise ValueError(f"{name} cannot be built with {options}: {error}.") from error
