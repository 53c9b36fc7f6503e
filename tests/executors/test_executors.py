import pytest
from tests.executors.tasks import die, fail, square, threads

from detpg.executors import InProcess, Processes, TaskError, WorkerLostError


def test_processes_give_what_in_process_gives():
    tasks, groups = list(range(7)), [0, 0, 0, 1, 1, 2, 2]
    here = {index: result[0] for index, result in InProcess(square).run(tasks, groups)}
    with Processes(square, 2) as executor:
        there = {index: result[0] for index, result in executor.run(tasks, groups)}
        again = {index: result[0] for index, result in executor.run(tasks[:1], groups[:1])}
    assert there == here == {i: i * i for i in tasks}
    assert again == {0: 0}


def test_a_worker_stays_with_its_groups():
    with Processes(square, 2) as executor:
        first = {i: pid for i, (_, pid) in executor.run([0, 1], ["a", "b"])}
        second = {i: pid for i, (_, pid) in executor.run([0, 1], ["b", "a"])}
    assert first[0] != first[1]
    assert (second[0], second[1]) == (first[1], first[0])


def test_an_idle_worker_helps_with_the_largest_group():
    with Processes(square, 2) as executor:
        pids = {pid for _, (_, pid) in executor.run(list(range(40)), ["a"] * 40)}
    assert len(pids) == 2


def test_an_error_of_the_work_is_raised_here():
    with (
        Processes(fail, 1) as executor,
        pytest.raises(TaskError, match="ValueError: task 3 is bad"),
    ):
        list(executor.run([3], ["a"]))


def test_a_killed_worker_is_one_sentence():
    with (
        Processes(die, 1) as executor,
        pytest.raises(WorkerLostError, match="run the same command"),
    ):
        list(executor.run([3], ["a"]))


def test_no_tasks_is_no_work():
    with Processes(square, 1) as executor:
        assert list(executor.run([], [])) == []


def test_a_worker_has_one_thread_of_xla():
    with Processes(threads, 1) as executor:
        assert list(executor.run([0], ["a"])) == [(0, "1")]
