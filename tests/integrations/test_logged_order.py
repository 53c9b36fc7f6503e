"""What tells the order of logged rows is looked at; what single precision would lose is told."""

import datetime
import decimal
import itertools
import json
import re
import warnings

import jax
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from detpg.algorithms import OPDAC
from detpg.integrations.logged import names, read, write
from detpg.replaying import learn_from
from detpg.types import Bounds

BOX = Bounds((-9.0,), (9.0,))
BASE = {
    "observation": [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
    "action": [0.0, 1.0, 0.0, 1.0, 0.0, 1.0],
    "reward": [0.0] * 6,
    "terminated": [False] * 6,
}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "log.parquet"


def table(path, metadata=None, **columns):
    given = {name: x for name, x in (BASE | columns).items() if x is not None}
    made = pa.table(given)
    pq.write_table(made.replace_schema_metadata(metadata) if metadata else made, path)
    return path


def refusal(place, bounds=BOX):
    with pytest.raises(ValueError) as caught:  # noqa: PT011  (the test reads the sentence)
        read(place, bounds)
    said = str(caught.value)
    assert said.endswith(".")
    assert "\n" not in said
    return said.replace(f" of {place}", "")


def told(place):
    with pytest.warns(UserWarning, match="row") as caught:
        data = read(place, BOX)
    assert {one.filename for one in caught} == {__file__}
    return data, [str(one.message).replace(f" of {place}", "") for one in caught]


def starts(data):
    return data.observation[:, 0].tolist()


FALLS = [6, 5, 4, 3, 2, 1]
DAY = datetime.datetime(2024, 5, 1)


def days(numbers):
    return [DAY + datetime.timedelta(days=n) for n in numbers]


NAMES = [
    "time",
    "Time",
    "TIME",
    "t",
    "t_s",
    "time_s",
    "time_ms",
    "Time [s]",
    "timeStamp",
    "timestamp_utc",
    "unix_time",
    "step",
    "Step",
    "env_step",
    "episode_step",
    "timestep",
    "time_step",
    "date",
    "datetime",
    "index",
    "Index",
    "row",
    "sample_index",
    "__index_level_0__",
    "Unnamed: 0",
]


@pytest.mark.parametrize("name", NAMES)
def test_a_column_that_falls_is_refused_whatever_it_is_called(path, name):
    assert refusal(table(path, **{name: FALLS})) == (
        f"{name} falls from 6 to 5 in row 1, inside an episode (the first of 5), and rows must be "
        f"in the order of time: sort them by episode and then by {name}; where it starts again, "
        "give a column episode or mark the row before in truncated; leave the column out if it "
        "tells no order."
    )


TYPES = {
    "int": pa.array(FALLS),
    "uint64": pa.array(np.asarray(FALLS, np.uint64) + np.uint64(2**63)),
    "nanoseconds": pa.array(np.asarray(FALLS) + 1_700_000_000_000_000_000),
    "float": pa.array(np.asarray(FALLS, float) / 10),
    "float32": pa.array(np.asarray(FALLS, np.float32)),
    "datetime": pa.array(days(FALLS)),
    "zone": pa.array(days(FALLS), pa.timestamp("ns", "Europe/Berlin")),
    "date": pa.array(days(FALLS), pa.date32()),
    "time of day": pa.array(FALLS, pa.time32("s")),
    "duration": pa.array(FALLS, pa.duration("ms")),
    "decimal": pa.array(map(decimal.Decimal, FALLS), pa.decimal128(20, 3)),
    "text": pa.array([one.isoformat() for one in days(FALLS)]),
    "zulu": pa.array([one.isoformat() + "Z" for one in days(FALLS)]),
    "digits": pa.array(["11", "10", "9", "8", "7", "6"]),
    "categories": pa.array([one.isoformat() for one in days(FALLS)]).dictionary_encode(),
}


@pytest.mark.parametrize("kind", TYPES)
def test_a_column_that_falls_is_refused_whatever_its_type(path, kind):
    assert " (the first of 5)" in refusal(table(path, time=TYPES[kind]))


def test_any_column_of_datetimes_tells_order(path):
    assert "Zeit falls from 2024-05-07 00:00:00" in refusal(table(path, Zeit=days(FALLS)))
    table(path, started_at=days([1] * 6))
    assert len(read(path, BOX)) == 5


def pandas(columns):
    return {b"pandas": json.dumps({"index_columns": columns}).encode()}


def test_pandas_index_is_looked_at(path):
    """Named, or kept as a range in the metadata alone, as after `df[::-1]`."""
    assert "nummer falls from 6 to 5" in refusal(table(path, pandas(["nummer"]), nummer=FALLS))
    backwards = {"kind": "range", "name": None, "start": 5, "stop": -1, "step": -1}
    assert "pandas' index falls from 5 to 4 in row 1" in refusal(table(path, pandas([backwards])))
    forwards = backwards | {"start": 0, "stop": 12, "step": 2}
    assert len(read(table(path, pandas([forwards])), BOX)) == 5


def test_a_sorted_log_may_keep_the_index_it_had(path):
    """After sorting by time, as the sentence says, pandas' index is in disorder."""
    data = read(table(path, time=FALLS[::-1], __index_level_0__=[3, 1, 5, 0, 4, 2]), BOX)
    assert len(data) == 5


@pytest.mark.parametrize("name", ["time", "index", "timestamp_ms"])
def test_a_column_that_stays_is_refused(path, name):
    said = refusal(table(path, **{name: [0, 1, 2, 2, 3, 4]}))
    assert said.startswith(
        f"{name} is 2 in row 3 and in the row before, inside an episode: log each step once;"
    )
    assert f"sort rows of several plants by a column episode and then by {name}" in said


def test_integers_of_time_are_compared_exactly(path):
    """Nanoseconds since 1970 that are one number in double precision."""
    stamps = 1_700_000_000_000_000_000 + np.arange(6)
    assert len(read(table(path, time=stamps), BOX)) == 5
    stamps[3] = stamps[2]
    assert "time is 1700000000000000002 in row 3" in refusal(table(path, time=stamps))


@pytest.mark.parametrize("kind", ["int", "float", "datetime"])
def test_a_gap_ends_the_episode(path, kind):
    numbers = [0, 1, 2, 5, 6, 7]
    column = {"int": numbers, "float": np.asarray(numbers) * 0.1 + 3, "datetime": days(numbers)}
    data, (said,) = told(table(path, time=column[kind]))
    assert starts(data) == [0, 1, 3, 4]
    assert data.next_observation[:, 0].tolist() == [1, 2, 4, 5]
    assert data.truncated.tolist() == [False, True, False, True]
    assert said.endswith(
        "in row 3, 3 times the usual step: rows are missing, so the episode is cut there; leave "
        "the column out if the row is the next step all the same."
    )


def test_clocks_that_tremble_or_are_irregular_have_no_gaps(path):
    assert len(read(table(path, time=[0.0, 0.11, 0.19, 0.3, 0.41, 0.5]), BOX)) == 5
    assert len(read(table(path, time=[0.0, 0.3, 2.0, 2.2, 5.1, 9.0]), BOX)) == 5


def test_what_is_between_episodes_is_no_gap(path):
    label, time = [1, 1, 1, 2, 2, 2], [0, 1, 2, 90, 91, 92]
    assert starts(read(table(path, episode=label, time=time), BOX)) == [0, 1, 3, 4]
    again = [0, 1, 2, 0, 1, 2]
    assert starts(read(table(path, episode=label, step=again), BOX)) == [0, 1, 3, 4]
    assert "step falls from 2 to 0 in row 3, inside an episode" in refusal(table(path, step=again))


def test_date_and_time_of_day_are_read_together(path):
    dates, hours = [1, 1, 1, 2, 2, 2], [21, 22, 23, 0, 1, 2]
    data = read(table(path, date=pa.array(days(dates), pa.date32()), time=hours), BOX)
    assert len(data) == 5
    hours[4] = 0
    assert "row 4" in refusal(table(path, date=days(dates), time=hours))


def test_a_second_clock_counts_too(path):
    """Rows that were numbered again after they had been turned round."""
    said = refusal(table(path, index=list(range(6)), time=FALLS))
    assert said.startswith("time falls from 6 to 5")
    said = refusal(table(path, step=list(range(6)), time=FALLS))
    assert said.startswith("time falls from 6 to 5")


@pytest.mark.parametrize("label", [[1, 2, 1, 2, 1, 2], ["a", "b", "a", "b", "a", "b"]])
def test_episodes_that_take_turns_are_to_be_sorted(path, label):
    a = label[0]
    assert refusal(table(path, episode=label)) == (
        f"Episode {a} goes on in row 2 after rows of another one, though nothing ends it in row 0: "
        "sort the rows by episode and then by time."
    )
    order = np.argsort(label, kind="stable")
    columns = {name: np.asarray(x)[order] for name, x in (BASE | {"episode": label}).items()}
    assert starts(read(table(path, **columns), BOX)) == [0, 2, 1, 3]
    with pytest.raises(ValueError, match=r"^Episode . goes on in row 2 after"):
        write(path, **columns | {"episode": label} | matrices(columns))


def matrices(columns):
    return {name: np.asarray(columns[name])[:, None] for name in ("observation", "action")}


def test_a_label_may_come_back_for_an_episode_of_its_own(path):
    ended = [False, True, False, True, False, False]
    data = read(table(path, episode=[1, 1, 2, 2, 1, 1], truncated=ended), BOX)
    assert starts(data) == [0, 2, 4]


def test_two_plants_in_turn_without_an_episode_are_told_apart(path):
    plants = ["left", "right"] * 3
    assert refusal(table(path, plant=plants)).startswith(
        "plant goes from left to right in row 1, where no episode ends: name it episode and sort "
    )
    assert "time is 0 in row 1 and in the row before" in refusal(
        table(path, time=[0, 0, 1, 1, 2, 2])
    )
    assert len(read(table(path, plant=["left"] * 6), BOX)) == 5
    cut = [False, True] * 3
    assert len(read(table(path, episode_id=[1, 1, 2, 2, 3, 3], truncated=cut), BOX)) == 3


def test_where_nothing_follows_the_advice_is_to_sort(path):
    said = refusal(table(path, episode=list(range(6))))
    assert said.endswith(
        "add the column; or, if rows of several episodes take turns, give each a label in the "
        "column episode and sort the rows by it and then by time."
    )


LOST = {
    "nan": (pa.array([1.0, 1.0, np.nan, 2.0, 2.0, 2.0]), "episode is nan in row 2, the first of 1"),
    "null": (pa.array([1, 1, None, 2, 2, 2]), "episode is empty in row 2"),
    "no date": (pa.array([*days([1, 1, 1, 2, 2]), None]), "episode is empty in row 5"),
    "list": (pa.array([[1]] * 6), "episode in .* is of type list"),
    "single": (
        pa.array(np.float32([2**24, 2**24, 2**24, 2**24 + 2, 2**24 + 2, 2**24 + 2])),
        r"episode reaches 1.67772e\+07 in row 3, where float32 makes one number of several",
    ),
}


@pytest.mark.parametrize("name", LOST)
def test_rows_of_no_episode_are_refused(path, name):
    column, said = LOST[name]
    assert re.match(said, refusal(table(path, episode=column)))


def test_labels_are_compared_exactly(path):
    label = [2**53, 2**53, 2**53, 2**53 + 1, 2**53 + 1, 2**53 + 1]
    assert starts(read(table(path, episode=label), BOX)) == [0, 1, 3, 4]
    given = BASE | matrices(BASE)
    with pytest.raises(ValueError, match=r"^episode is nan in row 0, the first of 6: give every"):
        write(path, **given, episode=[np.nan] * 6)


@pytest.mark.parametrize("vector", ["observation", "action", "next_observation"])
def test_a_vector_has_one_form(path, vector):
    given = {vector: [0.0] * 6, f"{vector}_0": [1.0] * 6}
    assert refusal(table(path, **given)) == (
        f"{path} has the columns {vector} and {vector}_0: leave one of the two forms out."
    )
    given = {vector: None, f"{vector}_0": [0.0] * 6, f"{vector}_2": [1.0] * 6}
    assert f"but no {vector}_1: number the components from 0" in refusal(table(path, **given))
    given = {vector: None, f"{vector}_1": [0.0] * 6}
    assert f"but no {vector}_0: number" in refusal(table(path, **given))


def test_two_columns_of_one_name(path):
    columns = [pa.array(x) for x in BASE.values()]
    pq.write_table(pa.table([*columns, columns[0]], names=[*BASE, "observation"]), path)
    assert refusal(path) == f"{path} has two columns observation: leave one of them out."


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("Truncated", "truncated"),
        ("timeouts", "truncated"),
        ("done", "truncated"),
        ("Reward", "reward"),
        ("Episode", "episode"),
        ("next_obs", "next_observation"),
        ("Next Observation", "next_observation"),
        ("nextObservation_0", "next_observation"),
    ],
)
def test_a_column_that_would_be_overlooked_is_named(path, name, known):
    assert refusal(table(path, **{name: [0.0] * 6})) == (
        f"{path} has a column {name}, which is not read: name it {known} if that is what it holds, "
        "or leave it out."
    )


def test_names_of_other_things_tell_no_order():
    for name in (
        "residence_time",
        "time_limit",
        "step_size",
        "T_in",
        "t_1",
        "temperature",
        "price",
    ):
        assert not any(is_one(name) for is_one in (names.is_time, names.is_place, names.is_group))


def test_a_sampling_time_tells_no_order(path):
    assert len(read(table(path, sample_time=[0.1] * 6, Ts=[0.1] * 6), BOX)) == 5


@pytest.mark.parametrize("empty", [None, float("nan")])
def test_every_row_has_its_time(path, empty):
    said = refusal(table(path, time=[0.0, 1.0, 2.0, empty, 4.0, 5.0]))
    assert said.startswith("time is empty in row 3: give every row its place in time")
    assert "time in" in refusal(table(path, time=["soon"] * 6))


NEXT = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]


def test_complete_rows_may_come_in_any_order(path):
    order = [3, 0, 5, 1, 4, 2]
    shuffled = {name: np.asarray(x)[order] for name, x in BASE.items()}
    following = np.asarray(NEXT)[order]
    data = read(table(path, **shuffled, next_observation=following, time=order), BOX)
    assert starts(data) == order
    assert len(read(table(path, next_observation=NEXT, time=[0, 1, 2, 7, 8, 9]), BOX)) == 6


def test_a_next_observation_that_is_another_is_told(path):
    wrong = [*NEXT[:2], 30.0, *NEXT[3:]]
    for more in ({}, {"time": list(range(6))}):
        data, (said,) = told(table(path, next_observation=wrong, **more))
        assert data.next_observation[:, 0].tolist() == wrong
        assert said.startswith(
            "next_observation is [30.0] in row 2, but the next row of the episode has the "
            "observation [3.0] (1 of 5 rows): it is taken, which is right for"
        )
    ended = [False, False, True, False, False, False]
    for flag in ("terminated", "truncated"):
        read(table(path, next_observation=wrong, **{flag: ended}), BOX)


def test_next_observations_made_of_reversed_rows_are_refused(path):
    said = refusal(table(path, next_observation=NEXT, time=FALLS))
    assert said.startswith("time falls from 6 to 5 in row 1")


@pytest.mark.parametrize("name", ["observation", "action", "reward", "next_observation"])
def test_what_single_precision_loses_is_refused(path, name):
    """Seconds since 1970, and whole numbers that become one."""
    for numbers in (1.7e9 + 10 * np.arange(6), 2**24 + np.arange(6)):
        far = Bounds((0.0,), (1e10,))
        said = refusal(table(path, **{name: numbers}), far)
        assert said.startswith(f"{name} is about 1.")
        assert "of which single precision loses" in said
        assert said.endswith("subtract a constant, such as the first value, before it is logged.")


def test_an_offset_that_leaves_the_signal_is_taken(path):
    numbers = 101_325 + 50 * np.sin(np.arange(6.0))
    assert len(read(table(path, observation=numbers), BOX)) == 5
    for still in ([0.1] * 6, [300.1, 300.1 + 1e-13] * 3, [*[100.1] * 5, 100.2]):
        assert len(read(table(path, reward=still), BOX)) == 5
    zeros = np.zeros(100_000)
    seldom = 100.1 + 0.1 * (np.arange(len(zeros)) == 7)
    columns = {"observation": zeros, "action": zeros, "terminated": zeros.astype(bool)}
    assert len(read(table(path, **columns, reward=seldom), BOX)) == len(zeros) - 1
    with pytest.raises(
        ValueError, match=r"^component 1 of observation is about 1.7e\+09 and varies"
    ):
        write(
            path,
            **BASE | matrices(BASE) | {"observation": np.stack([NEXT, 1.7e9 + np.arange(6)], 1)},
        )


def test_whole_numbers_that_become_one_are_told(path):
    data, (said,) = told(table(path, reward=[0, 1, 2, 2**24, 2**24 + 1, 5]))
    assert len(data) == 5
    assert said == (
        "reward is 16777216 in row 3 and 16777217 in row 4, of which single precision makes one "
        "number (the first of 1): log smaller numbers if the difference matters."
    )


def test_files_come_in_the_order_of_their_numbers(tmp_path):
    for k in (10, 2, 1):
        table(tmp_path / f"part-{k}.parquet", reward=[float(k)] * 6, time=list(range(6)))
    data = read(tmp_path, BOX)
    assert data.reward[::5].tolist() == [1, 2, 10]
    table(tmp_path / "part-2.parquet", time=FALLS)
    assert "part-2.parquet" in refusal(tmp_path)


def test_bounds_that_cannot_be_meant_are_none(path):
    huge = Bounds((-3.4e38,), (3.4e38,))
    data = read(table(path), huge)
    assert data.bounds == Bounds.unbounded(1)
    assert data.action[:, 0].tolist() == BASE["action"][:5]
    write(path, **BASE | matrices(BASE), bounds=Bounds.unbounded(1))
    assert read(path, huge).bounds == Bounds.unbounded(1)


def test_a_log_in_reverse_does_not_teach_the_other_sign(path):
    """On the page's plant s' = 0.8 s + 0.5 a + noise Riccati's gain is -1.16."""
    random = np.random.default_rng(0)
    s, rows = 0.0, []
    for t in range(2000):
        a = np.clip(0.3 * s + random.uniform(-1, 1), -2, 2)
        rows.append((t, s, a, -(s**2) - 0.1 * a**2))
        s = 0.8 * s + 0.5 * a + 0.1 * random.normal()
    columns = dict(zip(("time", "observation", "action", "reward"), np.array(rows).T))
    columns["terminated"] = np.zeros(2000, bool)
    box = Bounds((-2.0,), (2.0,))
    backwards = {name: x[::-1] for name, x in columns.items()}
    assert "time falls from 1999.0 to 1998.0 in row 1" in refusal(table(path, **backwards), box)
    order = np.argsort(backwards["time"])
    data = read(table(path, **{name: x[order] for name, x in backwards.items()}), box)
    learner = OPDAC.create(data.spec(discount=0.9), alpha_w=0.03, alpha_theta=0.01)
    run = jax.jit(learn_from, static_argnums=3)
    state, _ = run(learner, data, jax.random.key(0), 20_000)
    assert float(2 * state.learner.theta[0, 0]) == pytest.approx(-1.16, abs=0.05)


def test_nothing_is_said_of_a_log_in_order(path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for name, start in itertools.product(("time", "index"), (0, 10**12)):
            read(table(path, **{name: start + np.arange(6)}), BOX)
