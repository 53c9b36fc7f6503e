import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks_data import document
from detpg.environments import LQR, MountainCar, Pendulum, PuddleWorld
from detpg.features import TileCoding, divided
from detpg.policies import FeaturePolicy

LINE = TileCoding((0.0,), (1.0,), (4,), num_tilings=2)


def active(coding, *observation):
    return coding.active(jnp.asarray(observation, dtype=float)).tolist()


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize(
    ("name", "world"), [("mcar", MountainCar), ("pendulum", Pendulum), ("puddle", PuddleWorld)]
)
def test_every_recorded_set_of_active_tiles(name, world):
    recorded = document(f"tiles_{name}_big_10x10_bias")
    coding = TileCoding.for_environment(world().spec)
    assert (coding.size, coding.num_active) == (1001, 11)
    starts = [[dim["min"] for dim in tiling] for tiling in recorded["tilings"]]
    np.testing.assert_allclose(coding.starts, starts, rtol=1e-12)
    samples = recorded["samples"]
    found = jax.vmap(coding.active)(jnp.asarray([sample["s"] for sample in samples]))
    assert np.sort(found).tolist() == [sorted(sample["active"]) for sample in samples]


def test_big_tiles_by_hand():
    """o = 1 / (4 * 2 - 2 + 1) = 1/7, width 2/7; tilings start at 0 and at -1/7."""
    assert active(LINE, 0.0) == [0, 4, 8]
    # 0.5 / (2/7) = 1.75 and (0.5 + 1/7) / (2/7) = 2.25
    assert active(LINE, 0.5) == [1, 4 + 2, 8]
    assert active(LINE, 1.0) == [3, 4 + 3, 8]
    assert active(LINE, -5.0) == [0, 4, 8]
    assert active(LINE, 5.0) == [3, 7, 8]


def test_small_tiles_by_hand():
    """o = 1 / (5 * 2 - 1) = 1/9, width 2/9; tilings start at 0 and at 1/9."""
    coding = dataclasses.replace(LINE, partition="small", bias=False)
    # 0.5 / (2/9) = 2.25 and (0.5 - 1/9) / (2/9) = 1.75; 0.05 lies before the second tiling
    assert active(coding, 0.5) == [2, 4 + 1]
    assert active(coding, 0.05) == [0, 4]
    assert active(coding, 0.99) == [3, 4 + 3]


def test_a_wrapped_dimension_has_no_edge():
    coding = dataclasses.replace(LINE, wrapped=(0,), bias=False)
    # tiles of 1/4; the second tiling starts at -1/8
    assert active(coding, 0.95) == [3, 4 + 0]
    assert active(coding, 0.05) == [0, 4 + 0]
    for x in (0.05, 0.3, 0.8):
        assert active(coding, x) == active(coding, x + 1) == active(coding, x - 2)


def test_dimension_0_is_the_fastest():
    coding = TileCoding((0.0,) * 3, (1.0,) * 3, (2, 3, 4), num_tilings=1, bias=False)
    assert active(coding, 0.9, 0.5, 0.1) == [1 + 2 * 1 + 2 * 3 * 0]
    assert active(coding, 0.1, 0.9, 0.9) == [0 + 2 * 2 + 2 * 3 * 3]
    assert coding.size == 24


def test_jitter_shifts_each_tiling_down_by_at_most_half_of_it_in_units_of_the_shift():
    plain = TileCoding((0.0, 0.0), (1.0, 2.0), (5, 5), num_tilings=50)
    shifted = dataclasses.replace(plain, jitter=0.2, seed=1)
    down = (plain.starts - shifted.starts) * plain.density * 50
    assert 0 <= down.min() < 0.02
    assert 0.08 < down.max() <= 0.1
    assert len(np.unique(down)) == 100
    assert np.array_equal(shifted.starts, dataclasses.replace(shifted).starts)
    assert not np.array_equal(shifted.starts, dataclasses.replace(shifted, seed=2).starts)


def test_the_vector_has_ones_at_the_active_indices():
    coding = TileCoding.for_environment(PuddleWorld().spec, tiles=(3, 4), num_tilings=2)
    s = jnp.asarray([0.4, 0.7])
    expected = np.zeros(coding.size)
    expected[np.asarray(coding.active(s))] = 1
    np.testing.assert_array_equal(coding(s), expected)
    assert expected.sum() == coding.num_active == 3


def test_hashing_spreads_tiles_over_the_memory_and_adds_up_where_they_meet():
    coding = TileCoding((0.0,) * 8, (1.0,) * 8, (10,) * 8, num_tilings=8, memory=512)
    points = jax.random.uniform(jax.random.key(0), (4000, 8))
    found = np.asarray(jax.vmap(coding.active)(points))
    assert np.all(found[:, -1] == 512)
    # 32000 draws into 512 cells: chi-square, mean 511, standard deviation sqrt(2 * 511)
    counts = np.bincount(found[:, :-1].ravel(), minlength=512)
    expected = 32000 / 512
    assert abs(np.sum((counts - expected) ** 2 / expected) - 511) < 4.5 * math.sqrt(2 * 511)
    crowded = dataclasses.replace(coding, memory=1)
    assert crowded(points[0]).tolist() == [8.0, 1.0]


def test_nearby_observations_share_hashed_tiles():
    coding = TileCoding((0.0,) * 4, (1.0,) * 4, (6,) * 4, num_tilings=16, memory=10_000)
    s = jnp.full(4, 0.41)
    near, far = active(coding, *(s + 0.01).tolist()), active(coding, *(s + 0.4).tolist())
    here = set(active(coding, *s.tolist()))
    assert len(here & set(near)) > 10
    assert len(here & set(far)) <= 3


def test_one_coder_is_one_static_value():
    again = TileCoding((0.0,), (1.0,), (4,), num_tilings=2)
    assert again == LINE
    assert hash(LINE) == hash(again)
    assert jax.jit(lambda c, s: c.active(s), static_argnums=0)(LINE, jnp.ones(1)).tolist() == [
        3,
        7,
        8,
    ]


def test_a_policy_on_features_by_hand():
    policy = FeaturePolicy(LINE, action_size=2)
    theta = policy.init(jax.random.key(0))
    assert theta.shape == (2, 9)
    theta = theta.at[0, 1].set(1.0).at[0, 6].set(2.0).at[1, 8].set(-1.0).at[1, 0].set(7.0)
    assert policy(theta, jnp.asarray([0.5])).tolist() == [3.0, -1.0]


def test_step_sizes_are_divided_by_the_active_features():
    given = {"alpha_theta": 0.3, "alpha_w": jnp.asarray([3.0, 6.0]), "sigma": 0.5, "gamma": 0.9}
    found = divided(LINE, given)
    assert found["alpha_theta"] == pytest.approx(0.1)
    np.testing.assert_allclose(found["alpha_w"], [1.0, 2.0], rtol=1e-6)
    assert (found["sigma"], found["gamma"]) == (0.5, 0.9)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"high": (1.0, 1.0)}, r"^low, high and grid have 1, 2 and 1 entries: .*\.$"),
        ({"low": (), "high": (), "grid": ()}, r"^low, high and grid have 0, .*\.$"),
        ({"high": (math.inf,)}, r"^The bounds \(0\.0,\) and \(inf,\) cannot be covered.*\.$"),
        ({"high": (0.0,)}, "cannot be covered"),
        ({"grid": (0,)}, "at least one tile"),
        ({"grid": (2.5,)}, r"^grid \(2\.5,\) with \d+ tilings is not usable: give whole numbers,"),
        ({"num_tilings": 0}, "at least one tile"),
        ({"partition": "odd"}, r"^partition 'odd' is unknown: choose one of big, small\.$"),
        ({"wrapped": (1,)}, "names a dimension beyond 0"),
        ({"jitter": 2.0}, "jitter = 2 is not usable"),
        ({"grid": (2**30,), "num_tilings": 4}, "give a memory size"),
        ({"memory": 0}, "memory = 0 is not usable"),
    ],
)
def test_what_is_no_tile_coder_is_refused_in_one_sentence(change, sentence):
    with pytest.raises(ValueError, match=sentence):
        dataclasses.replace(LINE, **change)


def test_an_unbounded_environment_is_refused_in_one_sentence():
    with pytest.raises(ValueError, match=r"^The observations of 'lqr' have no bounds, .*\.$"):
        TileCoding.for_environment(LQR().spec)
