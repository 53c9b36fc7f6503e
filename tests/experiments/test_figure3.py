"""Figure 3's study: its design, its claims on made-up runs, shards that go on where they stood."""

import dataclasses
import re
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from detpg.experiments import octopus_shards
from detpg.experiments.figure3 import ARMS, FIGURE3, MAIN, TIMES
from detpg.experiments.figure3_claims import (
    converged,
    first_solved,
    judge,
    published_runs,
    relapsed,
)
from detpg.experiments.octopus_shards import (
    POLICY,
    environment_of,
    keep_policy,
    kept_policy,
    run_octopus_shard,
)
from detpg.experiments.selection import Choice, Selection
from detpg.experiments.study import Condition, Results
from detpg.experiments.sweep import plan

TINY = Condition("octopus-arm", (), (20, 40, 60))
POINT = {name: np.array([value]) for name, value in ARMS[0].committed}


def test_the_design_is_that_of_section_5_3():
    assert tuple(range(15_000, 300_001, 15_000)) == TIMES
    for arm in ARMS:
        environment = environment_of(arm)
        spec = environment.spec
        assert (spec.observation_size, spec.action_size, spec.time_limit) == (50, 20, 300)
        assert arm.algorithm == "copdac-q"
    smoke, quick, paper = (FIGURE3.presets[name] for name in ("smoke", "quick", "paper"))
    assert (quick.fresh_seeds, paper.fresh_seeds) == (10, 30)
    assert len(FIGURE3.at("smoke").conditions[0].times) == smoke.recordings
    assert FIGURE3.at("quick") == FIGURE3


def test_committed_points_lie_on_the_grid():
    for arm in ARMS:
        for name, value in arm.committed:
            assert value in dict(arm.grid)[name]


def test_published_runs():
    runs = published_runs()
    assert runs.shape == (10, 20)
    assert np.all(runs[:, 0] == pytest.approx(300, abs=0.5))
    # as the ten runs were read: 66.2 to 75.2 steps at the end, two of them relapsed on the way
    assert runs[:, -1].min() == pytest.approx(66.2, abs=0.1)
    assert runs[:, -1].max() == pytest.approx(75.2, abs=0.1)
    assert converged(runs).all()
    assert relapsed(runs).sum() == 2


def test_measures_by_hand():
    steps = np.full((4, 20), 300.0)
    steps[0, 10:] = 80  # converges
    steps[1, 5:] = 80
    steps[1, 8] = 100  # relapses, and converges all the same
    steps[2, 17:] = 80  # too late
    times = np.asarray(TIMES, dtype=float)
    assert converged(steps).tolist() == [True, True, False, False]
    assert relapsed(steps).tolist() == [False, True, False, False]
    first = first_solved(steps, times)
    assert first[:3].tolist() == [165_000, 90_000, 270_000]
    assert np.isnan(first[3])


def made_up(steps: np.ndarray) -> Results:
    condition = FIGURE3.conditions[0]
    choice = Selection((Choice("mean", "mean", 0, 0.0, ()),), 0, 0)
    key = (condition, MAIN)
    costs = {(*key, "fresh"): steps[None]}
    return Results(FIGURE3, {key: choice}, costs, {}, {MAIN: {}}, seed=0)


def test_claims_follow_the_runs():
    fast = np.maximum(0.9 * published_runs().mean(axis=0), 30) - np.linspace(0, 30, 20)
    fast = fast + np.zeros((30, 1))
    found = {claim.id.split("/")[0]: claim for claim in judge(made_up(fast))}
    assert (found["converged"].measured, found["converged"].verdict) == (1.0, "reproduced")
    assert found["end"].measured == pytest.approx(0.9 * 69.9 - 30, abs=0.1)
    assert found["end"].verdict == "not reproduced"  # quicker than the published 69.9
    assert found["never-slower"].measured <= 1
    assert found["never-slower"].verdict == "reproduced"
    lost = fast.copy()
    lost[:6] = np.nan
    found = {claim.id.split("/")[0]: claim for claim in judge(made_up(lost))}
    assert found["converged"].measured == 0.8
    assert found["converged"].num_diverged == 6
    assert found["never-slower"].verdict == "not reproduced"


@pytest.mark.parametrize(("runs", "lanes"), [(1, 16), (10, 16), (20, 20)])
def test_few_runs_fill_a_vector_of_the_processor(runs, lanes):
    """What is computed has sixteen rows or more, what comes out one for each run."""
    batch = octopus_shards._batch(lambda x, y: jnp.tanh(x) + y["z"])
    numbers = jnp.arange(runs, dtype=float), {"z": jnp.ones(runs)}
    (computed,) = re.findall(
        r"stablehlo.tanh .* : tensor<(\d+)xf32>", batch.lower(*numbers).as_text()
    )
    assert int(computed) == lanes
    np.testing.assert_allclose(batch(*numbers), np.tanh(np.arange(runs)) + 1, rtol=1e-6)


SHORT = dataclasses.replace(ARMS[0], options=(*ARMS[0].options, ("time_limit", 10)))


def shard(folder: Path | None):
    where = None if folder is None else str(folder)
    (one,) = plan(TINY, SHORT, "fresh", POINT, 2, shape=(1, 2), study_seed=3, folder=where)
    return one


def test_a_shard_that_was_killed_goes_on_to_the_same_bits(tmp_path, monkeypatch):
    whole = run_octopus_shard(shard(None))
    assert whole.shape == (1, 2, 3, 2)
    assert np.all(whole[..., 0] == 10)
    assert not np.array_equal(whole[0, 0], whole[0, 1])

    keep = octopus_shards._keep

    def keep_and_die(*arguments) -> None:
        keep(*arguments)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(octopus_shards, "_keep", keep_and_die)
        with pytest.raises(KeyboardInterrupt):
            run_octopus_shard(shard(tmp_path))
    np.testing.assert_array_equal(run_octopus_shard(shard(tmp_path)), whole)

    study = dataclasses.replace(FIGURE3, conditions=(TINY,))
    choice = Selection((Choice("mean", "mean", 0, 0.0, ()),), 0, 0)
    costs = {(TINY, MAIN, "fresh"): whole[..., 0]}
    results = Results(study, {(TINY, MAIN): choice}, costs, {}, {MAIN: POINT}, seed=3)
    keep_policy(results, [shard(tmp_path)], tmp_path)
    policy, theta = kept_policy(SHORT, environment_of(SHORT), tmp_path / POLICY)
    action = np.asarray(policy(theta, jnp.zeros(50)))
    assert action.shape == (20,)
    assert np.all((action > 0) & (action < 1))

    checkpoint = next(tmp_path.glob("task*.npz"))
    with pytest.raises(FileNotFoundError, match="of another policy"):
        kept_policy(SHORT, environment_of(SHORT), checkpoint)
    checkpoint.write_bytes(checkpoint.read_bytes()[:100])  # damaged: the shard starts over
    np.testing.assert_array_equal(run_octopus_shard(shard(tmp_path)), whole)
