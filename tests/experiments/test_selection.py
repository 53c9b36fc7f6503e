import numpy as np

from detpg.experiments.selection import lost, score, select

POINTS = {"alpha": np.array([0.1, 0.1, 1.0, 1.0]), "sigma": np.array([1.0, 2.0, 1.0, 2.0])}


def costs() -> np.ndarray:
    """4 points, 2 seeds, 20 recordings: slow but good, fast but poor, diverging, in between."""
    slow = np.r_[np.full(10, 50.0), np.full(10, 1.0)]
    fast = np.full(20, 5.0)
    wild = np.r_[np.full(19, 0.1), np.nan]
    between = np.r_[np.full(10, 20.0), np.full(10, 4.0)]
    return np.stack([np.stack([line, line]) for line in (slow, fast, wild, between)])


def test_scores_by_hand():
    np.testing.assert_allclose(score(costs(), "final", 100.0, 10)[:, 0], [1, 5, np.inf, 4])
    np.testing.assert_allclose(score(costs(), "mean", 100.0, 10)[:, 0], [25.5, 5, np.inf, 12])


def test_rules_pick_different_points():
    selection = select(costs(), POINTS, ("final", "mean"), "sigma", 100.0, 10)
    chosen = {choice.role: choice.index for choice in selection.choices}
    assert chosen == {
        "final": 0,
        "final sigma=1": 0,
        "final sigma=2": 3,
        "mean": 1,
        "mean sigma=1": 0,
        "mean sigma=2": 1,
    }
    assert selection.num_diverged == 2
    assert selection.num_runs == 8


def test_edges_are_reported_and_a_held_value_is_none():
    points = {"alpha": np.array([1.0, 2.0, 3.0]), "sigma": np.array([1.0, 1.0, 1.0])}
    for best, edges in ((0, ("alpha",)), (1, ()), (2, ("alpha",))):
        values = np.ones((3, 1, 20))
        values[best] = 0
        (choice,) = select(values, points, ("final",), None, 100.0, 10).choices
        assert (choice.index, choice.edges) == (best, edges)


def test_a_run_is_lost_if_it_is_not_finite_or_ends_too_high():
    runs = np.array([[1, 500, 1], [1, 1, 101], [np.nan, 1, 1], [1, np.inf, 1], [100, 100, 100]])
    assert lost(runs, above=100.0).tolist() == [False, True, True, True, False]
