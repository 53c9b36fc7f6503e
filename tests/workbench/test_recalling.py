"""Runs of learners with a memory: resumed to the bit, told how large, kept apart."""

import jax
import numpy as np
import pytest

from detpg import Trainer
from detpg.workbench.config import Config
from detpg.workbench.engines import engine_of
from detpg.workbench.learners import learner
from detpg.workbench.run import train_in
from detpg.workbench.session import Session

SMALL = {"hidden": [8], "options": {"batch": 4, "warm_up": 20, "memory": 60}}
RUN = {"log_every": 20, "evaluate_every": 40, "evaluation_episodes": 1, "checkpoint_every": 20}


def config(**settings):
    return Config.from_json(
        {"algorithm": "td3", "environment": "lqr", "time_limit": 7, "steps": 80, **RUN, **SMALL}
        | settings
    )


def session(config):
    engine = engine_of(config)
    return Session(config, engine, learner(config, engine.spec))


def advanced(one, steps):
    while one.step < steps:
        one.advance(steps)
    return jax.tree.map(np.asarray, one.kept.state)


def check_equal(one, other):
    jax.tree.map(np.testing.assert_array_equal, one, other)


@pytest.mark.parametrize("seeds", [1, 2])
def test_a_run_in_two_parts_is_equal_to_the_bit(tmp_path, seeds):
    """The second part longer than the first knew of: its memory has grown, and then wraps."""
    whole = advanced(session(config(seeds=seeds)), 80)
    train_in(tmp_path, config(seeds=seeds, steps=40))
    train_in(tmp_path, config(seeds=seeds))
    resumed = session(config(seeds=seeds))
    from detpg.runs import Checkpoints

    step, kept = Checkpoints(tmp_path / "checkpoints").restore(resumed.kept)
    assert step == 80
    check_equal(jax.tree.map(np.asarray, kept.state), whole)
    assert int(whole.memory[0].added[0]) == 80
    assert whole.memory[0].rows.shape[1] == 61


def test_seeds_side_by_side_are_those_alone():
    both = advanced(session(config(seeds=2)), 60)
    alone = advanced(session(config(seeds=1)), 60)
    check_equal(jax.tree.map(lambda leaf: leaf[:1], both.learner), alone.learner)
    check_equal(both.memory[0], alone.memory[0])
    assert np.any(both.memory[0].rows != both.memory[1].rows)


def test_a_memory_is_told_before_the_start_and_refused_where_it_does_not_fit(tmp_path, monkeypatch):
    told = []
    train_in(tmp_path, config(seeds=2), report=lambda progress: told.extend(progress.messages))
    assert "The memory of 60 transitions takes 3.9 kB for 2 learners." in told
    monkeypatch.setattr("detpg.workbench.sizes.memory", lambda: 10**9)
    big = {"options": {"memory": 10**9}, "steps": 10**9}
    with pytest.raises(
        ValueError,
        match=r"^A memory of 1,000,000,000 transitions takes 96\.0 GB for 1 learner while it is "
        r"saved or resumed, where 1\.0 GB are free: give a smaller one, such as --memory "
        r"5208333\.$",
    ):
        session(config(**big))


def test_a_trainer_remembers_however_long_it_learns(tmp_path):
    settings = {"hidden": (8,), "batch": 4, "warm_up": 20, "time_limit": 7, "log_every": 20}
    settings |= {"evaluate_every": 80, "evaluation_episodes": 1}
    trainer = Trainer("td3", "lqr", **settings)
    trainer.learn(40)
    trainer.save(tmp_path / "half")
    loaded = Trainer.load(tmp_path / "half").learn(40)
    trainer.learn(40)
    check_equal(*(jax.tree.map(np.asarray, x.session.kept.state) for x in (trainer, loaded)))
    assert int(trainer.session.kept.state.memory[0].sizes[0]) == 80
