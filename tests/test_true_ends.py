"""What a world leaves where an episode has terminated reaches no learner, whatever it is."""

import equinox as eqx
import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from detpg import ALGORITHMS, EnvironmentSpec, train
from detpg.integrations.gymnasium.worlds import open_worlds
from detpg.integrations.logged.parts import Part, checked
from detpg.replaying import Logged, learn_from
from detpg.types import Bounds
from detpg.workbench import Config
from detpg.workbench.hosted import Hosted
from detpg.wrappers import Metered, Normalised
from toys import Chain

KEY = jax.random.key(3)
SPEC = EnvironmentSpec("ending", 2, 1, (-1.0,), (1.0,), 100, 0.9)
SMALL = {"memory": 32, "batch": 4, "warm_up": 3}


class Ending(Chain):
    """The chain; where it has terminated, something else is observed."""

    end: jax.Array = eqx.field(default=0.0, converter=jnp.asarray)

    def observe(self, state):
        usual = super().observe(state)
        return jnp.where(self.terminated(state), jnp.full_like(usual, self.end), usual)


def learner_of(name, spec=SPEC):
    """As a run drives it: normalised and metered where it can be."""
    kind = ALGORITHMS[name]
    recalls = {field for field in SMALL if field in kind.__dataclass_fields__}
    learner = kind.create(spec, **{field: SMALL[field] for field in recalls})
    if learner.experience.kind == "fresh":
        return learner
    normalised = Normalised.create(spec, algorithm=learner, rewards=True)
    return Metered.create(spec, algorithm=normalised)


def check_same_and_finite(found, expected):
    """The learners, without the meter's count of what was seen."""
    for one, other in zip(*map(jax.tree.leaves, (found, expected)), strict=True):
        np.testing.assert_array_equal(one, other)
        assert np.all(np.isfinite(one))


@pytest.mark.parametrize("name", ALGORITHMS)
def test_it_is_as_if_zeros_were_there(name):
    is_bandit = name.startswith("bandit")
    worlds = [
        Ending(1, 1, end=end) if is_bandit else Ending(3, 100, end=end)
        for end in (0.0, jnp.nan, -jnp.inf)
    ]
    learner = learner_of(name, worlds[0].spec)
    steps = learner.experience.batch if is_bandit else 13

    @jax.jit
    def learnt(world):
        return train(learner, world, KEY, steps)[0].learner

    zeros, *others = map(learnt, worlds)
    for found in others:
        check_same_and_finite(found, zeros)
    if not is_bandit:  # all its actions earn the same here
        fresh = jax.tree.leaves(learner.init(jax.random.split(jax.random.split(KEY)[1])[0]))
        assert any(np.any(a != b) for a, b in zip(jax.tree.leaves(zeros), fresh, strict=True))


class Falls(gymnasium.Env):
    """Three steps, and a true end at which `end` is observed."""

    observation_space = Box(-1.0, 1.0, (2,))
    action_space = Box(-1.0, 1.0, (1,))
    end = 0.0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return np.array([0.0, 0.5], np.float32), {}

    def step(self, action):
        self.steps += 1
        over = self.steps == 3
        seen = np.full(2, Falls.end) if over else np.array([0.3 * self.steps, 0.5])
        return seen.astype(np.float32), float(action[0]), over, False, {}


@pytest.mark.parametrize("mode", [None, *AutoresetMode])
def test_in_worlds_of_the_host(mode, monkeypatch):
    make = Falls if mode is None else lambda: SyncVectorEnv([Falls], autoreset_mode=mode)
    config = Config("copdac-gq", "Falls", log_every=10)
    engine = Hosted(config, lambda num: open_worlds(make, num))
    engine.use(learner_of("copdac-gq"))
    found = []
    for end in (0.0, np.nan):
        monkeypatch.setattr(Falls, "end", end)
        state = engine.advance(engine.begin(), 10)
        played = engine.play(engine.learners(state), 2, seed=1)
        found.append((engine.metered(state), played))
    check_same_and_finite(found[1], found[0])
    engine.close()


def test_in_logged_data():
    rows = np.arange(6, dtype=np.float32)
    ends = rows % 3 == 2

    def part(end):
        following = np.where(ends[:, None], end, np.stack([rows + 1, rows], axis=1))
        return checked(
            Part(
                row="row {}".format,
                observation=np.stack([rows, rows - 1], axis=1),
                action=np.cos(rows)[:, None],
                reward=rows,
                terminated=ends,
                truncated=np.zeros(6, bool),
                next_observation=following,
            )
        )

    @jax.jit
    def learnt(columns):
        data = Logged(*columns, np.zeros(6, np.int32), bounds=Bounds((-1.0,), (1.0,)))
        return learn_from(learner_of("opdac"), data, KEY, 12)[0].learner

    def columns(end, x):
        return (x.observation, x.action, x.reward, end, x.terminated, x.truncated)

    read, raw = part(np.nan), np.where(ends[:, None], np.nan, part(0.0).next_observation)
    assert np.all(read.next_observation[ends] == 0)
    zeros = learnt(columns(part(0.0).next_observation, read))
    check_same_and_finite(learnt(columns(raw.astype(np.float32), read)), zeros)
    with pytest.raises(ValueError, match=r"^next_observation is \[nan, nan\] in row 0"):
        checked(part(0.0)._replace(next_observation=np.full((6, 2), np.nan)))
