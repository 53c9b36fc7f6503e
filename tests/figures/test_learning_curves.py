"""Learning curves of made-up runs: the right numbers, told apart, nothing hidden."""

import xml.etree.ElementTree as ET

import numpy as np
import polars as pl
import pytest

from detpg.evaluation import estimate
from detpg.figures import curves
from detpg.figures.curves import draw
from detpg.figures.measured import read
from made_runs import write_run

STEPS = np.asarray([0, 1000, 2000])


def change(path, name, *expressions):
    file = path / f"{name}.parquet"
    pl.read_parquet(file).with_columns(*expressions).write_parquet(file)


def spoil(path, seed, value):
    """A seed whose returns are no numbers from step 1000 on."""
    here = (pl.col("seed") == seed) & (pl.col("step") >= 1000)
    change(path, "evaluations", pl.when(here).then(value).otherwise("return").alias("return"))


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch):
    """The figures that are drawn, laid out and kept instead of written."""
    kept = []

    def keep(figure, *_):
        figure.draw_without_rendering()
        kept.append(figure)

    monkeypatch.setattr(curves, "save", keep)
    return kept


def test_a_point_is_the_mean_of_an_evaluation_s_episodes(tmp_path):
    curve = read(write_run(tmp_path / "run", num_seeds=12), "return")
    assert curve.steps.tolist() == STEPS.tolist()
    assert curve.seeds.tolist() == list(range(12))
    np.testing.assert_array_equal(curve.values, STEPS[:, None] + 10 * np.arange(12) + 0.5)
    assert np.all(read(curve.path, "length").values == 200.5)


def test_an_empty_cell_is_what_it_was_before(tmp_path):
    curve = read(write_run(tmp_path / "run"), "rollout/ep_rew_mean")
    np.testing.assert_array_equal(curve.values, [[-1.0, -2.0, -3.0]] * 2)
    late = (pl.col("seed") == 1) & (pl.col("step") == 500)
    change(curve.path, "metrics", pl.when(~late).then("rollout/ep_rew_mean"))
    with pytest.raises(ValueError, match=r"has no rollout/ep_rew_mean of every seed yet"):
        read(curve.path, "rollout/ep_rew_mean")


@pytest.mark.parametrize("statistic", ["iqm", "mean"])
def test_the_table_holds_what_is_drawn(statistic, tmp_path, figures):
    path = write_run(tmp_path / "run", num_seeds=6)
    spoil(path, 4, float("inf"))
    _, file = draw([path], "return", tmp_path / "curve.png", statistic)
    table = pl.read_csv(file)
    values = read(path, "return").values
    expected = estimate(values[:, [0, 1, 2, 3, 5]], statistic, num_resamples=999)
    thick = table.filter(line=statistic)
    for name in ("value", "low", "high"):
        np.testing.assert_allclose(thick[name], getattr(expected, name), rtol=1e-12)
    assert thick["seeds"].to_list() == [5, 5, 5]
    thin = table.filter(line="seed", seed=3)
    assert thin["value"].to_list() == values[:, 3].tolist()
    assert thin["low"].null_count() == 3
    drawn = [line.get_ydata() for line in figures[0].axes[0].lines]
    for column in (thick["value"], thin["value"]):
        assert any(np.array_equal(column, line) for line in drawn)


def test_what_a_lost_seed_did_does_not_set_the_scale(tmp_path, figures):
    path = write_run(tmp_path / "run")
    whole = read(path, "return").values
    spoil(path, 1, pl.when(pl.col("step") == 1000).then(-1e9).otherwise(float("nan")))
    draw([path], "return", tmp_path / "curve.png")
    (axis,) = figures[0].axes
    low, high = axis.get_ylim()
    assert -1000 < low < whole.min()
    assert whole.max() < high < 3000
    (entry,) = axis.get_legend().get_texts()
    assert entry.get_text() == "copdac-q (IQM of 2 seeds; 1 left out, not finite)"
    assert "did not stay finite" in figures[0].get_suptitle()


def test_one_seed_has_no_band_and_the_picture_says_so(tmp_path, figures):
    draw([write_run(tmp_path / "run", num_seeds=1)], "return", tmp_path / "curve.png")
    assert figures[0].get_suptitle() == "One seed: no interval"
    (axis,) = figures[0].axes
    assert axis.get_legend().get_texts()[0].get_text() == "copdac-q (1 seed, no interval)"
    assert not any(len(path.vertices) for band in axis.collections for path in band.get_paths())
    assert pl.read_csv(tmp_path / "curve.csv")["low"].null_count() == 6


def test_different_worlds_go_to_panels_of_their_own(tmp_path, figures):
    worlds = ["Pendulum-v1", "Hopper-v5", "Pendulum-v1", "Ant-v5", "Walker2d-v5"]
    algorithms = ["copdac-q", "copdac-q", "opdac", "copdac-q", "copdac-q"]
    paths = [
        write_run(tmp_path / f"run{i}", environment=world, algorithm=algorithm)
        for i, (world, algorithm) in enumerate(zip(worlds, algorithms))
    ]
    draw(paths, "return", tmp_path / "curve.png")
    panels = [axis for axis in figures[0].axes if axis.get_visible()]
    assert [axis.get_title() for axis in panels] == list(dict.fromkeys(worlds))
    looks = [[handle.get_color() for handle in axis.get_legend().legend_handles] for axis in panels]
    assert len(looks[0]) == 2
    assert looks[0][0] == looks[1][0] == looks[2][0]


def names(figure):
    texts = figure.axes[0].get_legend().get_texts()
    return [text.get_text().rpartition(" (")[0] for text in texts]


def test_runs_of_one_algorithm_are_told_apart_by_their_folders(tmp_path, figures):
    paths = [write_run(tmp_path / name) for name in ("a", "b")]
    paths.append(write_run(tmp_path / "c", algorithm="opdac"))
    draw([*paths, paths[0]], "return", tmp_path / "curve.png")
    assert names(figures[0]) == ["copdac-q, a", "copdac-q, b", "opdac"]


def test_long_names_are_told_apart_where_they_differ(tmp_path, figures):
    long = "pendulum-copdac-q-with-correlated-noise-alpha-theta-{}-natural-2026-03-04"
    paths = [write_run(tmp_path / long.format(rate)) for rate in ("0.003", "0.005")]
    paths.append(write_run(tmp_path / "other"))
    draw(paths, "return", tmp_path / "curve.png")
    assert names(figures[0]) == [
        "copdac-q, …theta-0.003…",
        "copdac-q, …theta-0.005…",
        "copdac-q, other",
    ]
    draw([paths[0], paths[2]], "return", tmp_path / "curve.png")
    alone = names(figures[1])[0]
    assert alone.startswith("copdac-q, pendulum")
    assert alone.endswith("2026-03-04")
    assert len(alone) <= len("copdac-q, ") + 36


def test_folders_of_one_name_are_told_apart_by_their_paths(tmp_path, figures):
    paths = [write_run(tmp_path / where / "run") for where in ("a", "b")]
    draw(paths, "return", tmp_path / "curve.png")
    first, second = names(figures[0])
    assert first != second


@pytest.mark.parametrize(("num_runs", "num_worlds"), [(1, 1), (12, 1), (5, 5)])
def test_the_legend_hides_nothing_and_nothing_is_cut_off(num_runs, num_worlds, tmp_path, figures):
    paths = [
        write_run(tmp_path / f"a-run-with-quite-a-name-{i}", environment=f"World-v{i % num_worlds}")
        for i in range(num_runs)
    ]
    draw(paths, "return", tmp_path / "curve.png")
    figure = figures[0]
    for axis in (axis for axis in figure.axes if axis.get_visible()):
        legend = axis.get_legend().get_window_extent()
        assert legend.y1 < axis.xaxis.label.get_window_extent().y0
        assert legend.y0 > 0
        assert legend.x0 > 0
        assert legend.x1 < figure.bbox.width
        assert axis.get_window_extent().height > 0.3 * figure.bbox.height / -(-num_worlds // 3)
    boxes = [axis.get_legend().get_window_extent() for axis in figure.axes if axis.get_visible()]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


@pytest.mark.parametrize(
    ("last", "label"),
    [(2000, "environment steps"), (20_000, "(thousands)"), (3_000_000, "(millions)")],
)
def test_the_steps_are_counted_in_numbers_that_can_be_read(last, label, tmp_path, figures):
    path = write_run(tmp_path / "run")
    change(path, "evaluations", pl.col("step") * (last // 2000))
    draw([path], "return", tmp_path / "curve.png")
    (axis,) = figures[0].axes
    assert axis.get_xlabel().endswith(label)
    assert axis.get_xlim()[1] < 2.2e3
    assert axis.get_ylabel() == "return (reward units)"


def test_the_picture_says_what_it_shows_and_comes_out_the_same_again(tmp_path):
    path, output = write_run(tmp_path / "run"), tmp_path / "curve.svg"
    draw([path], "train/td_error", output)
    before = output.read_bytes()
    ET.fromstring(before)
    for words in ("Pendulum-v1", "TD error", "95% bootstrap interval", "IQM of 3 seeds"):
        assert words in before.decode()
    draw([path], "train/td_error", output)
    assert output.read_bytes() == before
