"""What one COPDAC-Q update costs as the action or the policy doubles: the paper's O(mn).

phi(s, a) is one vector-Jacobian product, the actor's direction one Jacobian-vector and one
vector-Jacobian product. Beside it the same update with the m by n Jacobian written out.
"""

import dataclasses
import time
from collections.abc import Callable, Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from benchmarks.rows import Row
from detpg import trees
from detpg.algorithms import COPDACQ
from detpg.algorithms.copdac_q import COPDACQState
from detpg.critics import td_error
from detpg.executors import Processes
from detpg.policies import LinearPolicy, MLPPolicy
from detpg.types import Bounds, Number, Observation, Transition

IDS = ("compatible.double_m", "compatible.double_n")
ROUNDS = 15

Sized = LinearPolicy | MLPPolicy
Update = Callable[[COPDACQ, COPDACQState, Transition], COPDACQState]


@dataclasses.dataclass(frozen=True)
class ObservationValue:
    """V^v(s) = v^T s: costs next to nothing beside the policy.

    Attributes:
        observation_size: d.
    """

    observation_size: int

    def init(self, key: PRNGKeyArray) -> Float[Array, "obs"]:
        return jnp.zeros(self.observation_size)

    def __call__(self, v: Float[Array, "obs"], observation: Observation) -> Number:
        return jnp.dot(v, observation)


def rows(wanted: tuple[str, ...]) -> Iterator[Row]:
    """One row for each doubling, in a process of their own."""
    with Processes(_measure, 1) as executor:
        for _, row in executor.run(wanted, wanted):
            yield row


def _measure(name: str) -> Row:
    return _row(name, *_pair(name))


def _pair(name: str) -> tuple[Sized, Sized]:
    """The policy, and the one that is twice as large in one respect.

    A linear policy has n = m d: twice the observation is twice n, and m stays. Both fit into a
    core's cache of 1 MB, beyond which a number costs more to fetch. For m alone to double, nearly
    all parameters must be shared by the actions, in hidden layers.
    """
    if name == "compatible.double_n":
        return LinearPolicy(500, 64), LinearPolicy(1_000, 64)
    return MLPPolicy(64, 16, hidden=(512, 512)), MLPPolicy(64, 32, hidden=(512, 512))


def _row(name: str, base: Sized, doubled: Sized) -> Row:
    m, n = base.action_size, trees.num_parameters(base)
    m_doubled, n_doubled = doubled.action_size, trees.num_parameters(doubled)
    # Apart: after a large Jacobian the caches are cold.
    ours, ours_doubled = _microseconds(products, (base, doubled), 50)
    theirs, theirs_doubled = _microseconds(jacobian, (base, doubled), 3)
    return Row(
        id=name,
        value=ours_doubled,
        unit="µs/update",
        baseline=ours,
        ratio=ours_doubled / ours,
        note=f"cost at m {m_doubled}, n {n_doubled:,} over cost at m {m}, n {n:,}: lower is "
        f"better, O(mn) allows 2; with an explicit Jacobian {theirs_doubled / theirs:.2f}, which "
        f"costs {theirs_doubled / ours_doubled:.0f} times as much at the larger size",
    )


def _microseconds(update: Update, policies: tuple[Sized, ...], updates: int) -> list[float]:
    """Least time of one update with each policy, measured in turn: a busy spell hits them all."""
    programs = [_program(update, policy, updates) for policy in policies]
    least = [float("inf")] * len(programs)
    for call in programs:
        call()
    for _ in range(ROUNDS):
        for i, call in enumerate(programs):
            began = time.perf_counter()
            call()
            least[i] = min(least[i], 1e6 * (time.perf_counter() - began) / updates)
    return least


def _program(update: Update, policy: Sized, updates: int) -> Callable[[], None]:
    """Some updates on one transition in one compiled call, so that starting it does not count."""
    learner, state, transition = example(policy)

    @jax.jit
    def run(state: COPDACQState, transition: Transition) -> COPDACQState:
        def body(state: COPDACQState, _: None) -> tuple[COPDACQState, None]:
            return update(learner, state, transition), None

        return jax.lax.scan(body, state, None, length=updates)[0]

    return lambda: jax.block_until_ready(run(state, transition))


def example(policy: Sized) -> tuple[COPDACQ, COPDACQState, Transition]:
    """A learner, a state in which no weight is zero, and a transition."""
    d = policy.observation_size
    small = jnp.asarray(1e-9)  # costs what any step size costs, and the numbers stay as they are
    steps: dict[str, Any] = {"alpha_theta": small, "alpha_w": small, "alpha_v": small}
    bounds = Bounds.unbounded(policy.action_size)
    learner = COPDACQ(policy, ObservationValue(d), bounds, **steps)
    keys = jax.random.split(jax.random.key(0), 4)
    state = learner.init(keys[0])
    w = jax.random.normal(keys[1], trees.to_vector(state.w).shape)
    # theta as it is at first: saturated units would make numbers too small for full speed.
    state = eqx.tree_at(lambda s: s.w, state, trees.like(state.w, w))
    observations = jax.random.normal(keys[2], (2, d))
    actions = jax.random.normal(keys[3], (2, policy.action_size))
    reward, end = jnp.asarray(1.0), jnp.asarray(False)
    experience = observations[0], actions[0], reward, observations[1], actions[1], end
    return learner, state, Transition(*experience)


def products(learner: COPDACQ, state: COPDACQState, transition: Transition) -> COPDACQState:
    """The library's own update."""
    return learner.update(jax.random.key(0), state, transition)[0]


def jacobian(learner: COPDACQ, state: COPDACQState, transition: Transition) -> COPDACQState:
    """Eq. 19-22 as they are written, with grad_theta mu(s)^T as a matrix of m rows."""
    theta, s, next_s = state.theta, transition.observation, transition.next_observation
    rows = jax.jacrev(learner.policy)(theta, s)
    J = jax.vmap(trees.to_vector)(rows)
    w = trees.to_vector(state.w)
    phi = (transition.action - learner.policy(theta, s)) @ J
    value, phi_v = jax.value_and_grad(learner.state_value)(state.v, s)
    next_value = learner.state_value(state.v, next_s)
    r, end = transition.reward, transition.terminated
    delta = td_error(r, learner.gamma, end, next_value, value + phi @ w)
    return COPDACQState(
        theta=trees.add_scaled(theta, learner.alpha_theta, trees.like(theta, (J @ w) @ J)),
        w=trees.like(state.w, w + learner.alpha_w * delta * phi),
        v=state.v + learner.alpha_v * delta * phi_v,
        deviation=transition.action - learner.policy(theta, s),
    )
