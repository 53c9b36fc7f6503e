"""DDPG's and TD3's updates against the same arithmetic in NumPy, gradients included."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.algorithms.ddpg import DDPG
from detpg.algorithms.td3 import TD3
from detpg.critics.ensemble import EnsembleActionValues
from detpg.experience import Recalled
from detpg.policies.network import NetworkPolicy
from detpg.types import EnvironmentSpec, Transition

D, M, H, B = 3, 2, 5, 3
SPEC = EnvironmentSpec("small", D, M, (-1.0,) * M, (1.0,) * M, 200, 0.99)
GAMMA, TAU, ALPHA_THETA, ALPHA_W = 0.9, 0.1, 2e-3, 1e-2


@jax.jit
def update(learner, key, state, rows):
    return learner.update(key, state, rows)


def made(kind, **options):
    critics = 1 if kind is DDPG else 2
    parts = {
        "policy": NetworkPolicy(D, M, (H, H), output_width=1.0),
        "action_values": EnsembleActionValues(D, M, (H, H), "none", size=critics),
    }
    numbers = {"gamma": GAMMA, "tau": TAU, "alpha_theta": ALPHA_THETA, "alpha_w": ALPHA_W}
    return kind.create(SPEC, **parts | numbers | options)


def batch(seed=0, n=2):
    rng = np.random.default_rng(seed)
    return Recalled(
        observation=jnp.asarray(rng.normal(size=(B, D))),
        action=jnp.asarray(rng.uniform(-1, 1, (B, M))),
        rewards=jnp.asarray(np.array([[1.0, -0.5], [2.0, 0.0], [0.5, 0.25]])[:, :n]),
        next_observation=jnp.asarray(rng.normal(size=(B, D))),
        terminated=jnp.asarray([False, True, False]),
        steps=jnp.asarray([min(2, n), 1, min(2, n)]),
    )


def forward(layers, x):
    """Outputs, and what the backward pass needs; x has a row for each sample."""
    kept = []
    for i, layer in enumerate(layers):
        z = x @ layer["weight"].T + layer["bias"]
        kept.append((x, z))
        x = np.maximum(z, 0) if i < len(layers) - 1 else z
    return x, kept


def backward(layers, kept, g):
    """Gradients of the layers and of the input, for the gradient g of the outputs."""
    found = []
    for i in reversed(range(len(layers))):
        x, z = kept[i]
        if i < len(layers) - 1:
            g = g * (z > 0)
        found.append({"weight": g.T @ x, "bias": g.sum(axis=0)})
        g = g @ layers[i]["weight"]
    return found[::-1], g


def adam(layers, gradients, alpha):
    """A first step of Adam: moments start at 0 and are corrected for that."""

    def step(x, g):
        mean, square = 0.1 * g / (1 - 0.9), 0.001 * g**2 / (1 - 0.999)
        return x + alpha * mean / (np.sqrt(square) + 1e-8)

    return [{k: step(x[k], g[k]) for k in x} for x, g in zip(layers, gradients)]


def reference(learner, state, rows, noise, actor_moves):
    """The box, line by line, on the first update."""
    plain = jax.tree.map(np.asarray, state)
    critics = [
        jax.tree.map(lambda leaf, k=k: leaf[k], plain.w) for k in range(learner.action_values.size)
    ]
    joined = lambda s, a: np.concatenate([s, a], axis=1)  # noqa: E731
    s, a, s2 = (np.asarray(x) for x in (rows.observation, rows.action, rows.next_observation))
    a2 = np.clip(np.tanh(forward(plain.theta, s2)[0]) + noise, -1, 1)  # targets are copies yet
    q2 = np.min([forward(w, joined(s2, a2))[0][:, 0] for w in critics], axis=0)
    y = []
    for i in range(B):
        m = int(rows.steps[i])
        earned = sum(GAMMA**k * float(rows.rewards[i, k]) for k in range(m))
        y.append(earned + (0.0 if rows.terminated[i] else GAMMA**m * q2[i]))
    y = np.array(y)
    new_critics, errors = [], []
    for w in critics:
        q, kept = forward(w, joined(s, a))
        errors.append(y - q[:, 0])
        gradients, _ = backward(w, kept, (2 * (q[:, 0] - y) / B)[:, None])
        new_critics.append(adam(w, gradients, -ALPHA_W))
    theta = plain.theta
    if actor_moves:
        output, kept = forward(theta, s)
        mu = np.tanh(output)
        _, critic_kept = forward(new_critics[0], joined(s, mu))
        _, slope = backward(new_critics[0], critic_kept, np.ones((B, 1)))
        gradients, _ = backward(theta, kept, slope[:, D:] * (1 - mu**2) / B)
        theta = adam(theta, gradients, ALPHA_THETA)
    w = jax.tree.map(lambda *leaves: np.stack(leaves), *new_critics)
    return theta, w, np.sqrt(np.mean(errors[0] ** 2))


def check_equal(found, wanted):
    jax.tree.map(
        lambda x, y: np.testing.assert_allclose(x, y, rtol=1e-9, atol=1e-12), found, wanted
    )


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize(("kind", "delay"), [(DDPG, 1), (TD3, 1), (TD3, 2)])
def test_an_update_is_the_box_in_numpy(kind, delay):
    options = {"delay": delay, "smoothing": 0.0} if kind is TD3 else {}
    learner = made(kind, **options)
    state = learner.init(jax.random.key(1))
    after, info = update(learner, jax.random.key(2), state, batch())
    theta, w, error = reference(learner, state, batch(), 0.0, actor_moves=delay == 1)
    check_equal(after.theta, theta)
    check_equal(after.w, w)
    check_equal(info.delta, error)
    polyak = lambda old, new: (1 - TAU) * np.asarray(old) + TAU * np.asarray(new)  # noqa: E731
    check_equal(after.target_w, jax.tree.map(polyak, state.w, w))
    check_equal(after.target_theta, jax.tree.map(polyak, state.theta, theta))


@pytest.mark.usefixtures("x64")
def test_targets_are_smoothed_by_clipped_noise_of_every_sample_and_component():
    learner = made(TD3, smoothing=0.4, most_smoothing=0.5)
    state, key = learner.init(jax.random.key(1)), jax.random.key(5)
    noise = np.clip(0.4 * np.asarray(jax.random.normal(key, (B, M), float)), -0.5, 0.5)
    assert len(np.unique(noise)) > B  # one number for each component, not one for all
    after, _ = update(learner, key, state, batch())
    _, w, _ = reference(learner, state, batch(), noise, actor_moves=False)
    check_equal(after.w, w)


def test_between_its_steps_the_actor_and_its_moments_stand_still():
    learner = made(TD3)
    state = learner.init(jax.random.key(1))
    once, _ = update(learner, jax.random.key(2), state, batch())
    jax.tree.map(np.testing.assert_array_equal, once.theta, state.theta)
    jax.tree.map(np.testing.assert_array_equal, once.actor_optimiser, state.actor_optimiser)
    twice, _ = update(learner, jax.random.key(3), once, batch())
    assert any(
        np.any(np.asarray(x != y))
        for x, y in zip(jax.tree.leaves(twice.theta), jax.tree.leaves(once.theta))
    )
    thrice, _ = update(learner, jax.random.key(4), twice, batch())
    jax.tree.map(np.testing.assert_array_equal, thrice.theta, twice.theta)


def test_the_critics_differ_from_the_start_and_targets_are_copies_of_memory_too():
    learner = made(TD3)
    state = learner.init(jax.random.key(1))
    assert np.any(np.asarray(state.w[0]["weight"][0] != state.w[0]["weight"][1]))
    jax.tree.map(np.testing.assert_array_equal, state.target_w, state.w)
    jax.tree.map(np.testing.assert_array_equal, state.target_theta, state.theta)
    program = jax.jit(lambda state: state, donate_argnums=0)
    program(state)  # buffers that stood twice in it could not be given away


def test_exploration_is_in_units_of_the_box_and_stays_inside():
    learner = made(TD3, sigma=jnp.asarray([0.0, 5.0]), colour=0.0)
    state = learner.init(jax.random.key(1))
    moved = Transition(
        jnp.zeros(D), jnp.zeros(M), jnp.zeros(()), jnp.zeros(D), jnp.zeros(M), jnp.asarray(False)
    )
    state = learner.follow(jax.random.key(2), state, moved)
    observation = jnp.ones(D)
    mean, action = (
        learner.greedy(state, observation),
        learner.act(jax.random.key(0), state, observation),
    )
    assert float(action[0]) == pytest.approx(float(mean[0]))
    wanted = float(jnp.clip(mean[1] + 5.0 * state.noise.value[1], -1, 1))
    assert float(action[1]) == pytest.approx(wanted)


@pytest.mark.parametrize("pushed", [-3.0, 3.0])
def test_a_policy_without_a_tanh_is_led_back_into_the_box(pushed):
    """Where the critic says nothing of it, for its actions are all inside."""
    policy = dataclasses.replace(NetworkPolicy(D, M, (H,)), output="linear")
    learner = made(DDPG, policy=policy, alpha_theta=1e-2)
    state = learner.init(jax.random.key(1))
    *hidden, last = state.theta
    state = dataclasses.replace(state, theta=[*hidden, {**last, "bias": last["bias"] + pushed}])
    rows = batch()
    for _ in range(3):
        after, _ = update(learner, jax.random.key(2), state, rows)
        before, now = (
            np.abs(np.asarray(jax.vmap(policy, (None, 0))(x.theta, rows.observation)))
            for x in (state, after)
        )
        assert np.all(now < before)
        state = after


@pytest.mark.parametrize(
    ("name", "value"),
    [("memory", 0), ("batch", 0), ("n", -1), ("updates", 0.5), ("delay", True), ("warm_up", -1)],
)
@pytest.mark.usefixtures("unchecked")
def test_whole_numbers_that_cannot_be_are_refused(name, value):
    with pytest.raises(ValueError, match=rf"^{name} = .*: give (a whole number of|one)"):
        made(TD3, **{name: value})
