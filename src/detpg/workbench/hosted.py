"""Learners in worlds that the host steps: one compiled call for each step of all of them."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from detpg.learning import memory_of
from detpg.memory import cut
from detpg.policies import cap
from detpg.types import Action, Algorithm
from detpg.workbench.compiled import EVALUATION, LEARNING, host_seed, learner_keys
from detpg.workbench.config import Config
from detpg.workbench.driving import Apart, Driver, HostState, Together, act, apart, together
from detpg.workbench.failing import in_training
from detpg.workbench.judged import Judged
from detpg.workbench.learners import check_episodes
from detpg.workbench.opening import in_same_world, open_apart
from detpg.workbench.play import Played, discount, without_lost, worth
from detpg.world_error import WorldError
from detpg.wrappers import of_each_world, several_worlds
from detpg.wrappers.controller import in_world_units


class Hosted:
    """The engine of a Gymnasium environment.

    Attributes:
        bounds: Of the actions, in the world's own units.
        spec: Of the world, actions in units of the box.
        exact: Whether a resumed run equals one that was never stopped.
        resume_note: What a user is told about resuming.
        reached: Where an interval that was broken off stood, and the steps that led there.
    """

    exact = False
    resume_note = (
        "learners resume to the bit, but this world's state cannot be saved: a resumed run goes on "
        "with a new episode"
    )

    def __init__(self, config: Config, opened: Callable[[int], Any]):
        """Opens the worlds.

        Args:
            config: Of the run.
            opened: A number of copies -> `integrations.gymnasium.worlds.Worlds`.
        """
        self._config = config
        self._shape = config.seeds, config.num_envs
        self._worlds, self._judged = open_apart(config, opened)
        self._left = False  # whether the worlds have gone on without the learners
        self.bounds = self._worlds.spec.bounds
        low, high = self.bounds.scaled
        self.spec = dataclasses.replace(self._worlds.spec, action_low=low, action_high=high)
        self._action: np.ndarray | None = None
        self.reached: tuple[HostState, int] | None = None
        self._new = False  # whether nothing was judged yet

    def use(self, learner: Algorithm) -> None:
        """The learner that is driven.

        Raises:
            ValueError: It learns from batches of one-step episodes.
        """
        if learner.experience.kind == "fresh" and self.spec.time_limit == 1:
            raise ValueError(
                f"The learner takes batches of {learner.experience.batch} episodes side by side, "
                "which the host does not play: choose another algorithm."
            )
        check_episodes(learner, self.spec)
        self.learner = learner
        self._keys = learner_keys(self._config)

    def begin(self) -> HostState:
        """Before the first step."""
        self._new = True
        memories = [
            memory_of(self.learner, self.spec, self._config.steps, self._config.num_envs)
            for _ in self._keys
        ]
        memory = None if memories[0] is None else tuple(memories)
        return self._started(self._fresh(), memory, step=0)

    def resume(self, state: HostState, step: int) -> HostState:
        """The learners as they were, in new episodes: traces and correlated noise start anew."""
        self._new = False
        mask, fresh = of_each_world(state.learner), self._fresh()
        kept = jax.tree.map(
            lambda leaf, new, each: new if each else leaf, state.learner, fresh, mask
        )
        memory = None if state.memory is None else tuple(map(cut, state.memory))
        return self._started(kept, memory, step)

    def _fresh(self) -> PyTree:
        """The learners before the first step."""
        keys = jax.vmap(lambda key: jax.random.split(key)[1])(self._keys)
        worlds = self._config.num_envs
        fresh = jax.vmap(lambda key: several_worlds(self.learner.init(key), worlds))
        return jax.jit(fresh)(keys)

    def _started(self, learner: PyTree, memory: Any, step: int) -> HostState:
        """In new episodes, whose seeds follow from the run's and from the step."""
        words = self._config.seed, LEARNING, step
        seeds = [host_seed(*words, i) for i in range(self._worlds.num)]
        with in_training(self._config, step):
            observation = jnp.asarray(self._worlds.reset(seeds).reshape(*self._shape, -1))
        self._left = False
        steps = jnp.full(self._config.seeds, step, dtype=int)
        action = self._first(self._keys, learner, observation, steps)
        carried_out = jax.vmap(jax.vmap(self._carried_out))(action)
        self._action = np.asarray(carried_out).reshape(self._worlds.num, -1)
        return HostState(learner, observation, action, steps, memory)

    @functools.cached_property
    def _first(self) -> Callable[..., Any]:
        return jax.jit(jax.vmap(functools.partial(act, self.learner)))

    def _carried_out(self, action: Action) -> Action:
        # A learner that is lost stops neither the others nor the interval at whose end it is named.
        action = jnp.where(jnp.isfinite(action), action, jnp.zeros_like(action))
        return in_world_units(cap(action, self.spec.bounds), self.bounds)

    def advance(self, state: HostState, steps: int) -> HostState:
        """That many steps of each learner on; in new episodes where the worlds have been left."""
        if self._left or self._action is None:  # None: a world failed, who knows where it stands
            state = self.resume(state, int(state.steps[0]))
        drive, worlds = self._driver(state), self._worlds
        size, action, self._action = self.spec.observation_size, self._action, None
        seen = np.empty((worlds.num, 2 * size + 4), np.float32)
        shaped = seen.reshape(*self._shape, -1)
        begun, taken, self.reached = int(state.steps[0]), 0, None
        try:
            with in_training(self._config, begun, lambda: (drive.state, taken)):
                while taken < steps:
                    step = worlds.step(action)
                    seen[:, :size] = step.next_observation
                    seen[:, size:-4] = step.observation
                    seen[:, -4], seen[:, -3] = step.reward, step.terminated
                    seen[:, -2], seen[:, -1] = step.truncated, step.valid
                    action = drive(shaped)
                    taken += self._config.num_envs
        except WorldError:
            raise
        except BaseException:  # Ctrl-C: what a memory was given away for must not be lost
            self.reached = drive.state, taken
            raise
        self._action = action
        return drive.state

    def _driver(self, state: HostState) -> Driver:
        kind = Together if state.memory is None else Apart
        return kind(self._program, self._keys, state)

    @functools.cached_property
    def _program(self) -> Callable[..., Any]:
        recalls = self.learner.experience.kind == "recalled"
        return (apart if recalls else together)(self.learner, self._carried_out)

    def learners(self, state: HostState) -> PyTree:
        """States of the learners, seeds first, as they are in their first world."""
        mask = of_each_world(state.learner)
        return jax.tree.map(lambda x, each: x[:, 0] if each else x, state.learner, mask)

    def metered(self, state: HostState) -> PyTree:
        """States of the learners with all their worlds."""
        return state.learner

    def with_learners(self, state: HostState, learners: PyTree) -> HostState:
        """With other states of the learners."""
        return dataclasses.replace(state, learner=learners)

    def play(self, learners: PyTree, episodes: int, seed: int) -> Played:
        """Episodes of the mean policies, with seeds that are no learner's.

        They are played in worlds of their own, unless there are none.
        """
        self._left |= in_same_world(self._config)
        worlds = Judged(self._judged, self._new)
        num, own = worlds.num, host_seed(seed, EVALUATION)
        # The same episodes for all learners; of a vector environment each has several copies.
        copies = num // self._config.seeds
        observation = worlds.reset([own + i % copies for i in range(num)])
        gamma = float(discount(self.learner))
        rows: list[list[tuple[float, ...]]] = [[] for _ in range(num)]
        action, first = self._worth(learners, observation)
        total, length, earned = (np.zeros(num) for _ in range(3))
        while min(map(len, rows)) * copies < episodes:
            step = worlds.step(action)
            total += step.reward
            earned += gamma**length * step.reward
            length += step.valid
            over = step.terminated | step.truncated
            tails = self._worth(learners, step.next_observation)[1] if over.any() else total
            action, value = self._worth(learners, step.observation)
            first = np.where(step.valid, first, value)  # this call only began an episode
            for i in np.flatnonzero(over):
                tail = 0.0 if step.terminated[i] else gamma ** length[i] * tails[i]
                rows[i].append((total[i], length[i], earned[i] + tail, first[i]))
                total[i] = length[i] = earned[i] = 0.0
                first[i] = value[i]
        self._new = False
        least = min(map(len, rows))
        table = np.array([row[:least] for row in rows]).reshape(self._config.seeds, -1, 4)
        return without_lost(Played(*np.moveaxis(table[:, :episodes], -1, 0)), learners)

    def _worth(self, learners: PyTree, observation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        shaped = observation.reshape(self._config.seeds, -1, observation.shape[-1])
        action, value = self._worths(learners, shaped)
        return np.array(action).reshape(len(observation), -1), np.array(value).reshape(-1)

    @functools.cached_property
    def _worths(self) -> Callable[..., Any]:
        def one(state: PyTree, observation: Array) -> tuple[Array, Array]:
            action, value = worth(self.learner, state, observation)
            return self._carried_out(action), value

        return jax.jit(jax.vmap(jax.vmap(one, in_axes=(None, 0))))

    def close(self) -> None:
        """Closes the worlds."""
        self._worlds.close()
        if not in_same_world(self._config):
            self._judged.close()
