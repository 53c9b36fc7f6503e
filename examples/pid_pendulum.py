"""The three gains of a PID controller, which keeps a loaded pendulum upright.

A constant torque pushes the pendulum of Section 5.2, so that without its integral part the
controller holds it askew. The integral is part of the state of the world, and is observed. The
controller saturates as the motor does. OPDAC with a quadratic critic, `alpha_w` 0.03,
`alpha_theta` 0.001 and noise of width 0.5 N m; with noise of 0.2 the critic sees too little of what
an action does, and the gains may run away.

    python examples/pid_pendulum.py
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import tyro

import detpg
from detpg.algorithms import OPDAC
from detpg.environments import Pendulum
from detpg.policies import FunctionPolicy

LOAD, LIMIT = 0.5, 2.0  # torques, N m
NUM_EPISODES = 32


class Loaded(eqx.Module):
    """The pendulum near upright, a load on it, and the integral of its angle.

    Observation: angle (units of 0.1 rad), its integral (0.1 rad times 100 steps), v (rad per 100
    steps). Reward: 1 - (angle / 0.2 rad)^2. It starts at up to 0.1 rad and ends beyond 0.2 rad,
    from where the motor could not bring it back; 200 steps.
    """

    pendulum: Pendulum = Pendulum()

    @property
    def spec(self):
        """As of the pendulum, with another observation and time limit."""
        inside = self.pendulum.spec
        new = {"observation_size": 3, "time_limit": 200, "discount": 0.95}
        return dataclasses.replace(inside, observation_low=(), observation_high=(), **new)

    def initial(self, key):
        """The pendulum's state and the integral."""
        angle = jax.random.uniform(key, (), minval=-0.1, maxval=0.1)
        return jnp.stack([angle, jnp.zeros(()), jnp.zeros(())])

    def transition(self, key, state, action):
        """The load adds to what the motor can do."""
        torque = jnp.clip(action, -LIMIT, LIMIT) + LOAD
        angle, v = self.pendulum.transition(key, state[:2], torque)
        return jnp.stack([angle, v, state[2] + angle])

    def reward(self, state, action, next_state):
        """At most 1, and 0 where the episode ends."""
        return 1 - jnp.minimum((next_state[0] / 0.2) ** 2, 1.0)

    def terminated(self, state):
        """Whether it falls."""
        return jnp.abs(state[0]) > 0.2

    def observe(self, state):
        """What the controller reads."""
        angle, v, integral = state
        return jnp.stack([angle / 0.2, integral / 10, v / 5])


WORLD = Loaded()


def pid(gains, observation):
    """The torque -(p angle + i integral + d rate), softly limited to what the motor can do."""
    angle, integral, rate = observation
    torque = -(gains["p"] * angle + gains["i"] * integral + gains["d"] * rate)
    return LIMIT * jnp.tanh(jnp.stack([torque]) / LIMIT)


def learner():
    """OPDAC from gains that hold the pendulum, but askew and slowly."""
    policy = FunctionPolicy(pid, {"p": 4.0, "i": 0.0, "d": 1.5})
    rates = {"alpha_w": 0.03, "alpha_theta": 0.001}
    return OPDAC.create(WORLD.spec, policy=policy, sigma=0.5, **rates)


def train(key, steps):
    """The gains learnt, and the mean return before and after."""
    algorithm = learner()
    train_key, episodes_key = jax.random.split(key)
    keys = jax.random.split(episodes_key, NUM_EPISODES)

    def earned(state):
        return jnp.mean(jax.vmap(lambda k: detpg.greedy_return(algorithm, WORLD, k, state))(keys))

    state, _ = detpg.train(algorithm, WORLD, train_key, steps)
    before = earned(detpg.begin(algorithm, WORLD, train_key).learner)
    return state.learner.theta, before, earned(state.learner)


def main(steps: int = 50_000, seeds: int = 4):
    """Trains and prints what was learnt.

    Args:
        steps: Environment steps of each run.
        seeds: Runs, side by side.
    """
    keys = jax.random.split(jax.random.key(0), seeds)
    run = jax.jit(jax.vmap(train, in_axes=(0, None)), static_argnums=1)
    gains, before, after = jax.tree.map(np.asarray, run(keys, steps))
    for name, values in gains.items():
        print(f"gain {name}: {values.mean():.3f} +- {values.std():.3f}")
    print(f"return before: {before.mean():.2f}")
    print(f"return after:  {after.mean():.2f} +- {after.std():.2f}")
    return before, after


if __name__ == "__main__":
    tyro.cli(main)
