"""Runs on logged data: with a world that judges and without one."""

from contextlib import nullcontext as nothing

import jax
import jax.numpy as jnp
import numpy as np
import pyarrow.parquet as pq
import pytest

from detpg.integrations.logged import read, write
from detpg.replaying import learn_from
from detpg.runs import RunDirectoryError
from detpg.types import Bounds
from detpg.workbench import Config, open_run, train_in
from detpg.workbench.engines import engine_of
from detpg.workbench.learners import bare, learner

ROWS = 23  # an epoch ends in the middle of an interval
EVERY = {"log_every": 20, "evaluate_every": 20, "checkpoint_every": 20, "evaluation_episodes": 2}
KINDS = {"policy": "linear", "value": "quadratic"}


BOX = Bounds((-2.0,), (2.0,))


def written(path, bounds):
    """Unrelated transitions with the sizes of the regulator."""
    drawn, terminated = np.random.default_rng(0), np.arange(ROWS) % 5 == 4
    write(
        path,
        observation=drawn.normal(size=(ROWS, 2)),
        action=drawn.uniform(-2.0, 2.0, size=(ROWS, 1)),
        reward=drawn.normal(size=ROWS),
        next_observation=drawn.normal(size=(ROWS, 2)),
        terminated=terminated,
        truncated=~terminated,
        bounds=bounds,
    )
    return str(path)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return written(tmp_path_factory.mktemp("data") / "log.parquet", BOX)


def config(data, algorithm="opdac", **changes):
    return Config(
        algorithm, data=data, **{"seeds": 2, "seed": 3, "steps": 60} | EVERY | KINDS | changes
    )


def test_it_learns_what_learn_from_learns(data):
    engine = engine_of(config(data))
    plain = bare(config(data), engine.spec, None)
    engine.use(plain)
    state = engine.begin()
    for _ in range(3):
        state = engine.advance(state, 10)
    root = jax.random.fold_in(jax.random.key(3), 0)
    keys = jnp.stack([jax.random.fold_in(root, i) for i in (0, 1)])
    logged = read(data)
    expected, _ = jax.jit(jax.vmap(lambda key: learn_from(plain, logged, key, 30)))(keys)
    jax.tree.map(
        lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-6), state, expected
    )
    assert np.any(state.learner.theta[0] != state.learner.theta[1])
    assert engine.play(engine.learners(state), 1, 0) is None


def contents(path):
    arrays = {key: value.tobytes() for key, value in np.load(path / "last.npz").items()}
    return arrays, pq.read_table(path / "metrics.parquet").to_pylist()


def test_two_halves_are_a_whole_without_a_world(data, tmp_path):
    assert train_in(tmp_path / "whole", config(data, normalise="both")).finished
    train_in(tmp_path / "halves", config(data, normalise="both", steps=40))
    assert train_in(tmp_path / "halves", config(data, normalise="both")).finished
    assert contents(tmp_path / "halves") == contents(tmp_path / "whole")
    rows = contents(tmp_path / "whole")[1]
    assert [row["step"] for row in rows] == [20, 20, 40, 40, 60, 60]
    for row in rows:
        assert row["rollout/ep_rew_mean"] is None  # nobody lived these episodes
        assert row["eval/mean_reward"] is None
        assert row["train/td_error"] > 0
    assert pq.read_table(tmp_path / "whole" / "evaluations.parquet").num_rows == 0
    run = open_run(tmp_path / "whole")
    best, last = (run.controller(which, 1)(jnp.ones(2)) for which in ("best", "last"))
    np.testing.assert_array_equal(best, last)  # nothing judged


def test_a_learner_that_cannot_move_is_told_so_without_a_world(data, tmp_path):
    found = []
    still = config(data, seeds=1, options={"alpha_theta": 0.0})
    train_in(tmp_path / "run", still, report=lambda progress: found.extend(progress.messages))
    assert len(found) == 1
    assert found[0].startswith("seed 0: the policy changed by less than")


def test_a_world_judges(tmp_path):
    data = written(tmp_path / "log.parquet", None)
    run = config(data, environment="lqr", time_limit=10)
    engine = engine_of(run)
    engine.use(learner(run, engine.spec))
    played = engine.play(engine.learners(engine.begin()), 3, 0)
    assert played is not None
    assert played.lengths.tolist() == [[10] * 3] * 2
    assert np.all(played.returns < 0)


def test_a_run_is_judged_without_its_data(tmp_path):
    written(tmp_path / "log.parquet", None)
    for name, world in (("run", {"environment": "lqr", "time_limit": 10}), ("alone", {})):
        given = config(str(tmp_path / "log.parquet"), **world, steps=20)
        with pytest.warns(UserWarning, match="taken for the bounds") if not world else nothing():
            train_in(tmp_path / name, given)
    (tmp_path / "log.parquet").unlink()
    played = open_run(tmp_path / "run").play("last", 3).to_pydict()
    assert played["length"] == [10] * 6
    with pytest.raises(RunDirectoryError, match="alone was trained on logged data alone, and th"):
        open_run(tmp_path / "alone").play("last", 3)


def test_data_of_another_world_are_refused(data):
    with pytest.raises(
        ValueError, match=r"has 2 numbers in an observation and 1 in an action, but"
    ):
        engine_of(config(data, environment="Pendulum-v1"))


@pytest.mark.parametrize("name", ["dac", "stochastic-ac", "offpac"])
def test_learners_that_it_would_mislead_are_refused(data, name, tmp_path):
    fitting = {"policy": "mlp" if name == "dac" else "quadratic"}
    with pytest.raises(ValueError, match=r"cannot learn from logged data, since .*: take opdac"):
        train_in(tmp_path / "run", config(data, name, **fitting))
    assert not (tmp_path / "run").exists()
