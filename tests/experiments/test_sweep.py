import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from tests.experiments.tiny_study import STUDY

from detpg.algorithms import BanditCOPDAC
from detpg.environments import QuadraticBandit
from detpg.evaluation import greedy_return
from detpg.experiments.sweep import STREAMS, join, plan, run_shard
from detpg.training import train

CONDITION = dataclasses.replace(STUDY.conditions[1], times=tuple(range(12, 121, 12)))
ARM = STUDY.arms[0]


def shards(shape: tuple[int, int], num_seeds: int = 5):
    return plan(
        CONDITION,
        ARM,
        "fresh",
        ARM.points(),
        num_seeds,
        shape=shape,
        study_seed=7,
    )


def test_plan_covers_every_point_and_seed_once():
    covered = [
        (alpha, sigma, seed)
        for shard in shards((3, 2))
        for alpha, sigma in zip(*(values for _, values in shard.points), strict=True)
        for seed in shard.seeds
    ]
    points = ARM.points()
    assert len(covered) == len(set(covered)) == 8 * 5
    assert {a for a, _, _ in covered} == set(points["alpha_theta"])
    assert len({shard.name for shard in shards((3, 2))}) == 9


def test_join_puts_results_back_in_place():
    parts = shards((3, 2))
    index = {(a, s): i for i, (a, s) in enumerate(zip(*ARM.points().values(), strict=True))}
    results = [
        np.array(
            [
                [[100 * index[point] + seed] for seed in part.seeds]
                for point in zip(*(values for _, values in part.points), strict=True)
            ]
        )
        for part in parts
    ]
    joined = join(parts, results)
    expected = 100 * np.arange(8)[:, None] + np.arange(5)[None, :]
    np.testing.assert_array_equal(joined[:, :, 0], expected)


def test_shape_of_a_shard_does_not_change_a_run():
    wide = join(shards((8, 5)), [run_shard(s) for s in shards((8, 5))])
    narrow = join(shards((3, 2)), [run_shard(s) for s in shards((3, 2))])
    kept = ARM.points()["alpha_theta"] < 1  # a diverging run amplifies rounding without bound
    np.testing.assert_allclose(wide[kept], narrow[kept], rtol=1e-3)


def test_a_shard_is_the_same_as_one_run_by_hand():
    (shard,) = shards((8, 5))
    result = run_shard(shard)
    root = jax.random.fold_in(jax.random.key(7), STREAMS["fresh"])
    environment_key, run_key = jax.random.split(jax.random.fold_in(root, 3))
    environment = QuadraticBandit(3, "mixed", key=environment_key)
    learner = BanditCOPDAC.create(environment.spec, alpha_theta=0.1, sigma=0.01)
    train_key, evaluation_key = jax.random.split(run_key)
    _, log = train(
        learner,
        environment,
        train_key,
        120,
        probe=lambda state: -greedy_return(learner, environment, evaluation_key, state),
    )
    point = shard.points[0][1].index(0.1)  # sigma 0.01 is the first of its values
    # Batches of 2m = 6 steps, recorded every 12: the cost before the second update comes first.
    np.testing.assert_allclose(result[point, 3], log.probe[1::2], rtol=1e-3)
    assert result.shape == (8, 5, 10)


def test_the_recorded_cost_is_that_before_the_update():
    """With 2m = 50 = half the recording interval, the first value is after one update, not two."""
    condition = type(CONDITION)("bandit", (("m", 25), ("spectrum", "isotropic")), (100,))
    arm = type(ARM)("z", "bandit-copdac", (), (("alpha_theta", (0.0,)), ("sigma", (0.1,))))
    (shard,) = plan(
        condition,
        arm,
        "sweep",
        arm.points(),
        1,
        shape=(1, 1),
        study_seed=0,
    )
    # theta stays at 0, so the cost is 0.1 * 16 * 25 exactly.
    np.testing.assert_allclose(run_shard(shard), jnp.full((1, 1, 1), 40.0), rtol=1e-6)
