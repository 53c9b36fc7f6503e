"""What does not fit is refused in one sentence, before a compiled loop reads or writes there."""

import sys

import numpy as np
import pytest

from detpg.features import TileCoding
from detpg.kernels import Experience, active_features, replay, run
from detpg.machine import cores

ROOM = TileCoding((0.0, 0.0), (1.0, 1.0), (3, 3), num_tilings=2)


def refused(sentence, call, *arguments, **changes):
    with pytest.raises(ValueError, match=f"^{sentence}.*[.]$"):
        call(*arguments, **changes)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"threads": cores() + 1}, r"threads = \d+ is not usable: give 1 to \d+, the cores here"),
        ({"threads": 0}, "threads = 0 is not usable"),
        ({"points": [0]}, "1 numbers for 2 points"),
        ({"runs": []}, "Points and runs are numbered from 0, and at least one run"),
        ({"horizon": -1}, "horizon = -1 and episodes = 1 are not usable: give at least 0 steps"),
        ({"episodes": 0}, "horizon = 9 and episodes = 0 are not usable: .* 1 episode"),
        ({"evaluate_at": []}, "evaluate_at must ascend"),
        ({"evaluate_at": [5, 5]}, "evaluate_at must ascend"),
        ({"evaluate_at": [10]}, "evaluate_at must ascend"),
        ({"features": TileCoding((0.0,), (1.0,), (3,))}, "The tile coder has 1 dimensions"),
        ({"options": {"gradient": "scaled"}}, "gradient cannot be set here: choose from gamma, "),
        ({"options": {"natural": "yes"}}, "natural 'yes' is unknown: choose one of True, False"),
    ],
)
def test_arguments(changes, sentence):
    given = {"runs": range(3), "horizon": 9, "evaluate_at": [0, 6, 9]} | changes
    refused(sentence, run, "mountain-car", "copdac-q", {"sigma": [0.1, 0.2]}, **given)


@pytest.mark.parametrize(
    ("hyper", "sentence"),
    [
        ({"alpha": 1.0}, "alpha cannot be set here: choose from gamma, .*, natural"),
        ({"sigma": [0.1, -1.0]}, "sigma = -1 is not usable: give a finite number between "),
        ({"sigma": np.nan}, "sigma = nan is not usable"),
        ({"sigma": []}, r"The hyper-parameters have shapes that do not fit, sigma \(0,\): give"),
        ({"sigma": [[0.1]]}, r"The hyper-parameters have shapes that do not fit, sigma \(1, 1\)"),
        (
            {"sigma": [0.1, 0.2], "alpha_v": [0.1] * 3},
            r"The hyper-parameters .* alpha_v \(3,\), sigma \(2,\): give one number, or one for",
        ),
    ],
)
def test_hyper_parameters(hyper, sentence):
    refused(sentence, run, "pendulum", "copdac-q", hyper, runs=[0], horizon=1, evaluate_at=[1])


def test_names():
    given = {"runs": [0], "horizon": 1, "evaluate_at": [1]}
    words = "Learner 'dac' is not compiled: choose one of copdac-gq"
    refused(words, run, "pendulum", "dac", {}, **given)
    refused(
        "Task 'lqr' is not compiled: choose one of mountain-", run, "lqr", "copdac-q", {}, **given
    )
    options = {"correction": "print"}
    words = "correction 'print' is unknown: choose one of full, printed"
    refused(words, run, "pendulum", "copdac-gq", {}, options=options, **given)


def experience(**changes):
    """Three transitions between the features 0 and 1."""
    ones, rows = np.ones(3), np.tile([0, 1], (3, 1))
    ends = np.zeros(3, bool)
    return Experience(rows, ones[:, None], ones, rows, ends, ends)._replace(**changes)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"active": np.array([[0, 1], [0, 4], [0, 1]])}, "active has the index 4: give 0 to 3"),
        ({"next_active": np.full((3, 2), -1)}, "next_active has the index -1: give 0 to 3"),
        ({"next_active": np.zeros((3, 3), int)}, r"next_active has shape \(3, 3\), which does not"),
        ({"active": np.zeros(3, int)}, r"active has shape \(3,\), which does not fit"),
        ({"action": np.ones(3)}, r"action has shape \(3,\), which does not fit"),
        ({"action": np.ones((2, 1))}, r"action has shape \(2, 1\), which does not fit"),
        ({"ended": np.zeros(2, bool)}, r"ended has shape \(2,\), which does not fit"),
    ],
)
def test_experience_that_a_compiled_loop_would_leave_its_arrays_for(changes, sentence):
    """Nothing checks an index in a compiled loop: it would read, or write, somewhere else."""
    hyper = {"gamma": 0.9}
    assert replay("copdac-q", hyper, experience(), size=4)["v"].any()
    refused(sentence, replay, "copdac-q", hyper, experience(**changes), size=4)


def test_hyper_parameters_of_a_replay():
    refused("gamma is missing", replay, "copdac-q", {}, experience(), size=4)
    many = {"gamma": [0.9, 0.8]}
    refused("2 points cannot be replayed at once", replay, "copdac-q", many, experience(), size=4)


@pytest.mark.parametrize("shape", [(4, 3), (4, 1), (2,), ()])
def test_observations_of_another_shape(shape):
    assert active_features(ROOM, np.zeros((4, 2))).shape == (4, 3)
    sentence = r"The observations have shape \(.*\): give one row of 2 numbers for each"
    refused(sentence, active_features, ROOM, np.zeros(shape))


def test_weights_beyond_the_memory(monkeypatch):
    monkeypatch.setattr(sys.modules["detpg.kernels.run"], "memory", lambda: 20_000)
    sentence = "The weights of a run take 24,024 bytes, with 1 threads at once, and 20,000 are"
    given = {"runs": [0], "horizon": 1, "evaluate_at": [1]}
    refused(sentence, run, "pendulum", "copdac-q", {}, **given)
