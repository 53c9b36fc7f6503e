"""Probe environments: worlds so small that what must be learnt is known (Jones, 2021).

    from detpg.testing import PROBES, check_probe

    for probe in PROBES.values():
        check_probe(MyAlgorithm.create(probe.spec), probe)

Each adds one demand to those before it, so that the first that fails says where to look:

| probe | world | known | what is off otherwise |
| --- | --- | --- | --- |
| `constant-reward` | one step earns 1 | V = 1 | 2: bootstrapping through the end |
| `seen-reward` | one step earns s = -1 or 1 | V(s) = s | 0: a critic that is blind |
| `two-steps` | the second step earns 1 | V = gamma, 1 | 1: no discount; 0: no bootstrapping |
| `time-limit` | each step earns 1, cut after two | V = 2 | 4/3: a limit taken for an end |
| `best-action` | one step earns -(a - 1/2)^2 | mu = 1/2 | an actor that stays or descends |
| `best-line` | one step earns -(a - s/2)^2 | mu(s) = s/2 | an actor that is blind |
| `consequence` | a is seen next, and earns -(a - 1/2)^2 there | mu = 1/2 | 0: a myopic actor |

gamma = 1/2 in all of them. The manner is that of A. Jones, "Debugging RL, Without the Agonizing
Pain" (2021), https://andyljones.com/posts/rl-debugging.html.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray, PyTree

from detpg.learning import lesson
from detpg.testing.checks import require
from detpg.training import train
from detpg.types import Action, Algorithm, EnvironmentSpec, Number, Observation, Transition

GAMMA = 0.5
PART = 0.1  # of the distance to the nearest fault: how close what is learnt must come

Seen = tuple[float, ...]


class Place(eqx.Module):
    """What is observed, and steps since the start."""

    seen: Observation
    steps: Int[Array, ""]


class Learnt(NamedTuple):
    """What was learnt, at the observations whose answer is known."""

    values: Float[Array, "*seeds values"]
    actions: Float[Array, "*seeds actions"]


class Probe(eqx.Module):
    """A world of a step or two, with one action component, and what must be learnt of it.

    Attributes:
        name: Key in `PROBES`.
        starts: Observations of the first step, one drawn at random.
        earned: Reward of an observation and an action.
        hint: What to do about a learner that fails.
        fault: How far off the nearest faulty learner is.
        onwards: The next observation; the same one unless given.
        num_steps: Steps of an episode.
        ends: Whether it is terminated after them; else a time limit cuts it.
        values: Known V, as pairs of an observation and a number.
        actions: Known best actions, as pairs of an observation and a number.
    """

    name: str = eqx.field(static=True)
    starts: tuple[Seen, ...] = eqx.field(static=True)
    earned: Callable[[Array, Array], Array] = eqx.field(static=True)
    hint: str = eqx.field(static=True)
    fault: float = eqx.field(static=True)
    onwards: Callable[[Array, Array], Array] | None = eqx.field(static=True, default=None)
    num_steps: int = eqx.field(static=True, default=1)
    ends: bool = eqx.field(static=True, default=True)
    values: tuple[tuple[Seen, float], ...] = eqx.field(static=True, default=())
    actions: tuple[tuple[Seen, float], ...] = eqx.field(static=True, default=())

    @property
    def spec(self) -> EnvironmentSpec:
        unbounded = float("inf")
        size = len(self.starts[0])
        return EnvironmentSpec(
            self.name, size, 1, (-unbounded,), (unbounded,), self.num_steps, GAMMA
        )

    def initial(self, key: PRNGKeyArray) -> Place:
        seen = jax.random.choice(key, jnp.asarray(self.starts, dtype=float))
        return Place(seen, steps=jnp.asarray(0, dtype=int))

    def transition(self, key: PRNGKeyArray, state: Place, action: Action) -> Place:
        seen = state.seen if self.onwards is None else self.onwards(state.seen, action)
        return Place(seen, state.steps + 1)

    def reward(self, state: Place, action: Action, next_state: Place) -> Number:
        return self.earned(state.seen, action)

    def terminated(self, state: Place) -> Bool[Array, ""]:
        return (state.steps >= self.num_steps) & self.ends

    def observe(self, state: Place) -> Observation:
        return state.seen


def _one(seen: Array, action: Array) -> Array:
    return jnp.ones((), seen.dtype)


def _last_seen(seen: Array, action: Array) -> Array:
    return seen[-1]


def _near_half(seen: Array, action: Array) -> Array:
    return -((action[0] - 0.5) ** 2)


def _near_line(seen: Array, action: Array) -> Array:
    return -((action[0] - 0.5 * seen[0]) ** 2)


def _seen_near_half(seen: Array, action: Array) -> Array:
    return -((seen[1] - 0.5) ** 2)


def _second(seen: Array, action: Array) -> Array:
    return jnp.asarray([0.0, 1.0], seen.dtype)


def _what_was_done(seen: Array, action: Array) -> Array:
    return jnp.zeros_like(seen).at[1].set(action[0])


HERE, FIRST, SECOND = (1.0,), (1.0, 0.0), (0.0, 1.0)

PROBES: dict[str, Probe] = {
    probe.name: probe
    for probe in (
        Probe(
            name="constant-reward",
            starts=(HERE,),
            earned=_one,
            values=((HERE, 1.0),),
            fault=1.0,
            hint="let the critic's step shrink delta, and take no value from a terminal s'",
        ),
        Probe(
            name="seen-reward",
            starts=((-1.0,), (1.0,)),
            earned=_last_seen,
            values=(((-1.0,), -1.0), ((1.0,), 1.0)),
            fault=1.0,
            hint="let the critic read the observation before the action, not the one after it",
        ),
        Probe(
            name="two-steps",
            starts=(FIRST,),
            onwards=_second,
            earned=_last_seen,
            num_steps=2,
            values=((FIRST, GAMMA), (SECOND, 1.0)),
            fault=0.5,
            hint="bootstrap from s' with weight gamma",
        ),
        Probe(
            name="time-limit",
            starts=(HERE,),
            earned=_one,
            num_steps=2,
            ends=False,
            values=((HERE, 1 / (1 - GAMMA)),),
            fault=2 / 3,
            hint="bootstrap where a time limit cuts: only `terminated` is an end",
        ),
        Probe(
            name="best-action",
            starts=(HERE,),
            earned=_near_half,
            actions=((HERE, 0.5),),
            fault=0.5,
            hint="look at the sign of the actor's direction, and at the exploration",
        ),
        Probe(
            name="best-line",
            starts=tuple((s,) for s in (-1.0, -0.5, 0.5, 1.0)),
            earned=_near_line,
            actions=(((-1.0,), -0.5), ((0.5,), 0.25), ((1.0,), 0.5)),
            fault=0.5,
            hint="let critic and actor read the same observation, that of the action",
        ),
        Probe(
            name="consequence",
            starts=(FIRST,),
            onwards=_what_was_done,
            earned=_seen_near_half,
            num_steps=2,
            actions=((FIRST, 0.5),),
            fault=0.5,
            hint="let the actor climb Q(s, a) with what s' is worth, not the reward alone",
        ),
    )
}


def learnt(algorithm: Algorithm, probe: Probe, key: PRNGKeyArray, steps: int) -> Learnt:
    """What a learner says after some steps, at the observations with a known answer.

    A value is `info.value` of an update there: what the critic says of the greedy action, or, for
    a learner with batches, of a batch of its own actions. Pure: jit and vmap it as you like.

    Args:
        algorithm: The learner.
        probe: Where it learns.
        key: Key of the run.
        steps: Environment steps (static).
    """
    train_key, value_key = jax.random.split(key)
    state, _ = train(algorithm, probe, train_key, steps)

    def value(seen: Observation) -> Number:
        return _value(algorithm, probe, value_key, state.learner, seen)

    def action(seen: Observation) -> Number:
        return algorithm.greedy(state.learner, seen)[0]

    return Learnt(_each(value, probe.values), _each(action, probe.actions))


def check_probe(
    algorithm: Algorithm,
    probe: Probe,
    key: PRNGKeyArray | None = None,
    *,
    steps: int = 20_000,
    seeds: int = 4,
) -> None:
    """Checks that a learner learns what is known of a probe, from every one of several seeds.

    Each answer must be within a tenth of the distance to what the nearest fault would learn.

    Args:
        algorithm: The learner. Give it step sizes small enough that what is left of the noise is
            a fortieth of that distance, and large enough for the number of steps.
        probe: One of `PROBES`, or one's own.
        key: Source of the runs; seed 0 when not given.
        steps: Environment steps of each run.
        seeds: Number of runs.

    Raises:
        AssertionError: What was found, what was expected and how to mend it.
    """
    keys = jax.random.split(jax.random.key(0) if key is None else key, seeds)
    found = jax.jit(jax.vmap(lambda key: learnt(algorithm, probe, key, steps)))(keys)
    for words, numbers, known in (
        ("V", found.values, probe.values),
        ("mu", found.actions, probe.actions),
    ):
        for k, (seen, answer) in enumerate(known):
            _check(f"{words}{seen}", np.asarray(numbers[:, k]), answer, probe, steps)


def _check(words: str, numbers: np.ndarray, answer: float, probe: Probe, steps: int) -> None:
    distance = np.where(np.isfinite(numbers), np.abs(numbers - answer), np.inf)
    worst, most = numbers[np.argmax(distance)], PART * probe.fault
    require(
        bool(distance.max() <= most),
        f"On {probe.name}, {words} is {worst:.3g} after {steps} steps",
        f"{answer:.3g} to within {most:.2g}",
        probe.hint,
    )


def _each(answer: Callable[[Array], Array], known: tuple[tuple[Seen, float], ...]) -> Array:
    if not known:
        return jnp.zeros(0)
    return jax.vmap(answer)(jnp.asarray([seen for seen, _ in known], dtype=float))


def _value(
    algorithm: Algorithm, probe: Probe, key: PRNGKeyArray, learner: PyTree, seen: Observation
) -> Number:
    def there(action: Action) -> Transition:
        parts: dict[str, Any] = {"observation": seen, "next_observation": seen}
        parts |= {"action": action, "next_action": action, "reward": probe.earned(seen, action)}
        return Transition(**parts, terminated=jnp.asarray(True))

    if algorithm.experience.kind == "each":
        transition = there(algorithm.greedy(learner, seen))
    else:
        keys = jax.random.split(key, algorithm.experience.batch)
        transition = lesson(
            algorithm, jax.vmap(lambda key: there(algorithm.act(key, learner, seen)))(keys)
        )
    return algorithm.update(key, learner, transition)[1].value
