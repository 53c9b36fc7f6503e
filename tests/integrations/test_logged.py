"""Logged data read from files and data sets; what is wrong with them is said in one sentence."""

import re

import jax
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from detpg.integrations.logged import read, write
from detpg.types import Bounds

BOX = Bounds((-2.0, 0.0), (2.0, 1.0))
# Two episodes: the first terminates after 3 steps, the second is cut after 2.
COLUMNS = {
    "observation": [[0.0], [1.0], [2.0], [10.0], [11.0]],
    "action": [[2.0, 1.0], [-2.0, 0.0], [0.0, 0.5], [1.0, 0.25], [0.0, 1.0]],
    "reward": [1.0, 2.0, 3.0, 4.0, 5.0],
    "terminated": [False, False, True, False, False],
    "truncated": [False, False, False, False, True],
}
NEXT = [[1.0], [2.0], [3.0], [11.0], [12.0]]


def table(path, **columns):
    """A file as another program would write it; None leaves a column out."""
    given = {name: x for name, x in (COLUMNS | columns).items() if x is not None}
    pq.write_table(pa.table(given), path)
    return path


def refusal(place, bounds=BOX):
    with pytest.raises(ValueError) as caught:  # noqa: PT011  (the test reads the sentence)
        read(place, bounds)
    said = str(caught.value)
    assert said.endswith(".")
    assert "\n" not in said
    return said


@pytest.fixture
def path(tmp_path):
    return tmp_path / "log.parquet"


def test_what_was_written_is_read_in_units_of_the_box(path):
    write(path, **COLUMNS, next_observation=NEXT, bounds=BOX)
    data = read(path)
    assert data.bounds == BOX
    np.testing.assert_array_equal(data.observation, np.asarray(COLUMNS["observation"], np.float32))
    np.testing.assert_array_equal(data.next_observation, np.asarray(NEXT, np.float32))
    expected = [[1, 1], [-1, -1], [0, 0], [0.5, -0.5], [0, 1]]
    np.testing.assert_array_equal(data.action, np.asarray(expected, np.float32))
    assert data.reward.tolist() == COLUMNS["reward"]
    assert data.terminated.tolist() == COLUMNS["terminated"]
    assert data.truncated.tolist() == COLUMNS["truncated"]
    assert data.episode.tolist() == [0, 0, 0, 1, 1]
    kinds = {x.dtype.name for x in jax.tree.leaves(data)}
    assert kinds == {"float32", "bool", "int32"}


def test_the_next_observation_is_that_of_the_following_row(path):
    """The last row of the cut episode has none, and goes; the terminal one needs none."""
    data = read(table(path), BOX)
    assert data.observation[:, 0].tolist() == [0, 1, 2, 10]
    assert data.next_observation[[0, 1, 3], 0].tolist() == [1, 2, 11]
    assert data.terminated.tolist() == [False, False, True, False]
    assert data.truncated.tolist() == [False, False, False, True]
    assert data.episode.tolist() == [0, 0, 0, 1]


def test_an_episode_column_marks_ends_that_the_flags_do_not(path):
    no, label = [False] * 5, ["a", "a", "b", "b", "b"]
    data = read(table(path, terminated=no, truncated=None, episode=label), BOX)
    assert data.observation[:, 0].tolist() == [0, 2, 10]
    assert data.episode.tolist() == [0, 1, 1]
    whole = [[1.0], [7.0], [10.0], [11.0], [12.0]]
    data = read(
        table(path, terminated=no, truncated=None, episode=label, next_observation=whole), BOX
    )
    assert data.episode.tolist() == [0, 0, 1, 1, 1]
    assert data.truncated.tolist() == [False, True, False, False, True]


def test_numbered_columns_fixed_lists_and_plain_numbers_are_the_same(path):
    expected = read(table(path), BOX)
    actions = np.asarray(COLUMNS["action"])
    numbered = {"action": None, "action_0": actions[:, 0], "action_1": actions[:, 1]}
    fixed = pa.FixedSizeListArray.from_arrays(pa.array(actions.ravel()), 2)
    plain = np.ravel(COLUMNS["observation"]).astype(int)
    flags = np.asarray(COLUMNS["terminated"], np.int8)
    for changed in (numbered, {"action": fixed}, {"observation": plain}, {"terminated": flags}):
        found = read(table(path, **changed), BOX)
        assert jax.tree.all(jax.tree.map(np.array_equal, found, expected))


def test_a_folder_is_its_files_one_after_another(tmp_path):
    (tmp_path / "b").mkdir()
    write(tmp_path / "a.parquet", **COLUMNS, bounds=BOX)
    table(tmp_path / "b" / "c.parquet", reward=[6.0, 7.0, 8.0, 9.0, 10.0])
    (tmp_path / ".half.parquet").write_text("unfinished")
    data = read(tmp_path)
    # the last row of each file has no following one
    assert data.reward.tolist() == [1, 2, 3, 4, 6, 7, 8, 9]
    assert data.episode.tolist() == [0, 0, 0, 1, 2, 2, 2, 3]


def test_bounds_that_nobody_gives_are_those_seen_and_it_is_said(path):
    with pytest.warns(UserWarning, match=r"least and greatest .*\[-2, 0\] and \[2, 1\]") as caught:
        data = read(table(path))
    assert data.bounds == Bounds((-2.0, 0.0), (2.0, 1.0))
    assert caught[0].filename == __file__


def test_bounds_that_disagree_with_the_data_are_told(path):
    """Actions in units of the box, say, of a world that is wider."""
    write(path, **COLUMNS, next_observation=NEXT, bounds=BOX)
    wide = Bounds(BOX.low, tuple(2 * end for end in BOX.high))
    with pytest.warns(UserWarning, match=r"says that actions lie between .* are taken: log act"):
        assert read(path, wide).bounds == wide
    rounded = Bounds(*(tuple(end * (1 + 1e-9) for end in ends) for ends in BOX))
    assert read(path, rounded).bounds == rounded


def test_a_component_without_bounds_keeps_its_unit(path):
    endless = Bounds((-np.inf, 0.0), (np.inf, 1.0))
    write(path, **COLUMNS, bounds=endless)
    data = read(path)
    assert data.bounds == endless
    np.testing.assert_array_equal(data.action[:, 0], np.asarray(COLUMNS["action"])[:4, 0])


def test_a_file_is_whole_or_absent(path):
    write(path, **COLUMNS)
    before = path.read_bytes()
    with pytest.raises(ValueError, match=r"^reward is nan in row 2, the first of 1: give"):
        write(path, **(COLUMNS | {"reward": [0, 1, np.nan, 3, 4]}))
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


NAN, INF = float("nan"), float("inf")
WRONG = {
    "no reward": ({"reward": None}, "has no column reward: it has observation, action, terminated"),
    "no action": ({"action": None}, "has no column action or action_0, action_1, ...: it has obs"),
    "a gap": (
        {"action": None, "action_0": [0.0] * 5, "action_2": [0.0] * 5},
        "has the columns action_0, action_2, but no action_1: number",
    ),
    "ragged": (
        {"observation": [[1.0], [1.0], [1.0, 2.0], [1.0], [1.0]]},
        "observation has 2 entries in row 2 of .*, but 1 in row 0: give lists of one length",
    ),
    "no entries": (
        {"observation": [[]] * 5},
        "observation (is a list of no|in .* is of type null)",
    ),
    "nan": ({"reward": [1.0, NAN, 2.0, NAN, 3.0]}, "reward is nan in row 1 of .*, the first of 2"),
    "inf": (
        {"observation": [[1.0], [1.0], [1.0], [1.0], [INF]]},
        r"observation is \[inf\] in row 4 of .*, the first of 1: give finite",
    ),
    "too large": ({"reward": [1e39] * 5}, r"reward is 1e\+39 in row 0 of .*, the first of 5"),
    "null": ({"reward": [1.0, None, 2.0, 2.0, 2.0]}, "reward is empty in row 1 of"),
    "null inside": (
        {"action": [[0.0, 0.0]] * 3 + [[0.0, None]] * 2},
        "action has an empty entry in row 3 of",
    ),
    "text": ({"reward": ["a"] * 5}, "reward in .* is of type string: give numbers"),
    "flags": ({"terminated": [0, 1, 2, 0, 1]}, "terminated in .* is of type int64: give booleans"),
    "outside": (
        {"action": [[0.0, 0.0]] * 4 + [[0.0, 1.5]]},
        "Action component 1 is 1.5 in row 4 of .*, outside its bounds 0 and 1: log actions",
    ),
    "another size": (
        {"next_observation": [[1.0, 2.0]] * 5},
        "next_observation has 2 components and observation 1 in row 0 of",
    ),
    "cut at every step": (
        {"truncated": [True] * 5, "terminated": [False] * 5},
        "has no next_observation, and no row is followed by another of its episode",
    ),
    "one action": ({"action": [[1.0]] * 5}, "The bounds are for 2 action components, but there"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_is_wrong_is_refused(path, name):
    columns, said = WRONG[name]
    assert re.search(said, refusal(table(path, **columns)))


def test_files_that_are_none_are_refused(tmp_path, path):
    assert "holds no Parquet file and is no Minari data set" in refusal(tmp_path)
    assert "There is no file" in refusal(path)
    path.write_text("observation,action")
    assert "cannot be read as a Parquet file" in refusal(path)
    schema = pa.table(COLUMNS).schema
    pq.write_table(schema.empty_table(), path)
    assert "holds no rows: record some steps first" in refusal(path)


def test_files_of_different_worlds_are_refused(tmp_path):
    write(tmp_path / "a.parquet", **COLUMNS, bounds=BOX)
    write(tmp_path / "b.parquet", **COLUMNS, bounds=Bounds((-9.0, -9.0), (9.0, 9.0)))
    assert "has other action bounds than" in refusal(tmp_path)
    table(tmp_path / "b.parquet", observation=[[0.0, 0.0]] * 5)
    assert "observation has 2 components in row 0 of" in refusal(tmp_path)


def test_bounds_that_are_none_are_refused(path):
    table(path)
    assert "are no box: give low < high" in refusal(path, Bounds((0.0, 1.0), (0.0, 2.0)))
    table(path, action=[[0.0, 1.0], [1.0, 1.0], *[[0.5, 1.0]] * 3])
    assert "Action component 1 is 1 in every row and no bounds are given" in refusal(path, None)
    scrawl = pa.table(COLUMNS).replace_schema_metadata({"detpg": '{"action_low": [0]}'})
    pq.write_table(scrawl, path)
    assert "has metadata 'detpg' that cannot be read" in refusal(path)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"reward": [1.0]}, "observation has 5 rows and reward 1 in row 0: give one"),
        ({"terminated": [False]}, "terminated has 1 rows and reward 5 in row 0: give one"),
        ({"action": [1.0] * 5}, r"action has shape \(5,\): give one row for each step"),
        ({"bounds": Bounds((-1.0, 0.0), (1.0, 1.0))}, "Action component 0 is 2 in row 0, outside"),
    ],
)
def test_what_cannot_be_right_is_not_written(path, changed, said):
    with pytest.raises(ValueError, match=rf"^{said}.*\.$"):
        write(path, **(COLUMNS | changed))
    with pytest.raises(ValueError, match=r"does not end in \.parquet"):
        write(path.with_suffix(".csv"), **COLUMNS)
    assert not list(path.parent.iterdir())
