"""Warnings: each for a run that shows it, none for a healthy one."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pyarrow.parquet as pq
import pytest
from slope import Slope

from detpg.types import Bounds
from detpg.workbench import Config, train_in
from detpg.workbench.compiled import Compiled
from detpg.workbench.diagnosis import Fault, ended, faults, warnings
from detpg.workbench.hosted import Hosted
from detpg.wrappers import Meter
from detpg.wrappers.metered import QUANTITIES

HEALTHY = {
    "train/saturated": 0.1,
    "train/exploration": 0.3,
    "train/policy_change": 1e-3,
    "eval/value_bias": 0.2,
    "eval/value_scale": 1.0,
}
SICK = {
    "saturated": {"train/saturated": 0.95},
    "exploration": {"train/exploration": 1e-4},
    "stuck": {"train/policy_change": 0.0},
    "overestimated": {"eval/value_bias": 2.5, "eval/value_scale": 1.0},
}


def rows(*changes):
    return [HEALTHY | change for change in changes]


def test_a_healthy_run_is_told_nothing():
    assert warnings(rows({}, {}, {}, {})) == {}
    assert warnings([]) == {}


@pytest.mark.parametrize("kind", SICK)
def test_each_sign_has_its_warning_once_three_rows_agree(kind):
    sick = SICK[kind]
    assert list(warnings(rows({}, sick, sick, sick))) == [kind]
    assert warnings(rows(sick, sick)) == {}
    assert warnings(rows(sick, sick, {})) == {}
    assert warnings(rows(sick, {}, sick)) == {}


@pytest.mark.parametrize("kind", SICK)
def test_what_was_not_measured_warns_of_nothing(kind):
    for nothing in (None, float("nan")):
        unknown = dict.fromkeys(SICK[kind], nothing)
        assert warnings(rows(unknown, unknown, unknown)) == {}


def test_rows_between_evaluations_do_not_hide_what_those_show():
    between = {"train/policy_change": None, "eval/value_bias": None, "eval/value_scale": None}
    sick = SICK["stuck"] | SICK["overestimated"]
    found = warnings(rows(sick, between, sick, between, sick, between))
    assert set(found) == {"stuck", "overestimated"}
    assert "promises 2.5 more than episodes return (their size is 1)" in found["overestimated"]


def test_a_value_below_the_return_is_no_overestimate():
    low = {"eval/value_bias": -50.0}
    assert warnings(rows(low, low, low)) == {}


def test_faults_are_named_for_each_learner():
    next_observation = QUANTITIES.index("next observation") + 2 * len(QUANTITIES)  # its third
    of_each = {
        "fault": [0, QUANTITIES.index("reward"), 0, QUANTITIES.index("TD error"), next_observation],
        "fault_step": [0, 17, 0, 5, 6],
        "age": [40] * 5,
    }
    several = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, 5), Meter.new())
    meter = eqx.tree_at(
        lambda tree: [getattr(tree, name) for name in of_each],
        several,
        list(map(jnp.asarray, of_each.values())),
    )
    world = "the world returned what is not finite, as "
    assert faults(meter, np.array([True, True, False, False, False])) == {
        1: Fault(f"{world}the reward of step 18", by_world=True),
        2: Fault("a parameter is not finite at step 40", by_world=False),
        3: Fault("the TD error of step 6 is not finite", by_world=False),
        4: Fault(f"{world}component 2 of the observation, at step 7", by_world=True),
    }


def test_what_ends_a_run_is_told_of_the_world_or_of_the_learner():
    world = Fault("the world returned what is not finite, as the reward of step 7", by_world=True)
    own = Fault("the TD error of step 9 is not finite", by_world=False)
    box, line = Bounds((-1.0,), (1.0,)), Bounds((-1.0,), (jnp.inf,))
    found = {
        "only the world": ended({0: world}, box, "no checkpoint is kept"),
        "a learner too": ended({0: world, 1: own}, box, "no checkpoint is kept"),
        "driven there": ended({0: world}, line, "no checkpoint is kept"),
    }
    assert {what: f"{type(error).__name__} {error}" for what, error in found.items()} == {
        "only the world": "WorldError The run is lost: the world returned what is not finite, as "
        "the reward of step 7. Let it return finite numbers, or terminate where it breaks down.",
        "a learner too": "DivergedError The run diverged: the TD error of step 9 is not finite; no "
        "checkpoint is kept. Lower the step sizes, or normalise observations and rewards.",
        "driven there": "DivergedError The run diverged: the world returned what is not finite, as "
        "the reward of step 7; no checkpoint is kept. Its actions have no bounds: give it some, or "
        "lower the step sizes; if they were small, mend the world.",
    }


EVERY = {"log_every": 10, "evaluate_every": 10, "checkpoint_every": 10, "evaluation_episodes": 1}


def told(path, **changes):
    found = []
    config = Config(
        **{"algorithm": "opdac", "environment": "lqr", "time_limit": 10, "steps": 40}
        | EVERY
        | changes
    )
    train_in(path, config, report=lambda progress: found.extend(progress.messages))
    return found


def test_a_learner_that_cannot_move_is_told_so_once_for_each_seed(tmp_path):
    options = {"alpha_theta": 0.0, "sigma": 0.0}
    found = told(tmp_path / "run", options=options, seeds=2, hidden=(2,), value="quadratic")
    kinds = ["actions hardly differ from the mean action", "the policy changed by less than"]
    for seed in (0, 1):
        own = [words for words in found if words.startswith(f"seed {seed}: ")]
        assert len(own) == 2
        assert all(any(kind in words for words in own) for kind in kinds)


def test_one_lost_learner_of_two_is_named_and_the_other_goes_on(tmp_path, monkeypatch):
    begin = Compiled.begin

    def theta(state):
        return state.learner.learner.theta

    def spoilt(self):
        state = begin(self)
        return eqx.tree_at(theta, state, theta(state).at[1].set(jnp.nan))

    monkeypatch.setattr(Compiled, "begin", spoilt)
    small = {"policy": "linear", "value": "quadratic", "normalise": "none"}
    found = told(tmp_path / "run", seeds=2, **small)
    assert [words for words in found if "lost, " in words] == [
        "seed 1: lost, the TD error of step 1 is not finite."
    ]
    table = pq.read_table(tmp_path / "run" / "evaluations.parquet").to_pylist()
    assert all(np.isfinite(row["return"]) == (row["seed"] == 0) for row in table)


def test_a_lost_learner_is_not_the_best_of_its_seed(tmp_path, monkeypatch):
    """In a world of the host its actions are the centre of the box, which may earn more."""
    advance, shown = Hosted.advance, []

    def spoilt(self, state, steps):
        after = advance(self, state, steps)
        lost = after.learner.learner.theta.at[1].set(jnp.nan)
        return eqx.tree_at(lambda tree: tree.learner.learner.theta, after, lost)

    monkeypatch.setattr(Hosted, "advance", spoilt)
    small = {"policy": "linear", "value": "quadratic", "normalise": "none"}
    config = Config("opdac", "Slope", seeds=2, steps=20, **EVERY, **small)
    train_in(tmp_path, config, world=Slope, report=lambda told: shown.append(told.returned))
    best = np.load(tmp_path / "best.npz")
    assert all(np.isfinite(best[name]).all() for name in best.files)
    assert np.isfinite(shown).all()
    table = pq.read_table(tmp_path / "evaluations.parquet").to_pylist()
    lost = [row["step"] > 0 and row["seed"] == 1 for row in table]
    assert np.isnan([row["return"] for row in table]).tolist() == lost
