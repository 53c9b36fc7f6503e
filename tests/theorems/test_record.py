"""How checks are judged, and how exponents are fitted."""

import math

import numpy as np
import pytest

from detpg.theorems.record import (
    Slope,
    check,
    exponent,
    fitted_power,
    fitted_slope,
    guide,
    points,
    relative_error,
    rounding,
)


@pytest.mark.parametrize(
    ("relation", "measured", "passed"),
    [
        ("within", 1.1, True),
        ("within", 1.3, False),
        ("within", [1.1, 0.7], False),
        ("within", math.nan, False),
        ("at least", 1.3, True),
        ("at least", 1.1, False),
        ("at least", math.inf, False),
        ("at most", 0.7, True),
        ("at most", 0.9, False),
        ("at most", -math.inf, False),
    ],
)
def test_the_three_rules(relation: str, measured, passed: bool):
    assert check("a/b", "a statement", measured, 1.0, 0.2, relation).passed is passed


@pytest.mark.parametrize("relation", ["within", "at least", "at most"])
@pytest.mark.parametrize("bad", [math.inf, -math.inf, math.nan])
def test_what_is_not_finite_judges_nothing(relation: str, bad: float):
    assert not check("a/b", "any number will do", 1.0, 1.0, bad, relation).passed
    assert not check("a/b", "any number will do", 1.0, bad, 0.0, relation).passed
    assert not check("a/b", "one of two", [1.0, 1.0], 1.0, [0.0, bad], relation).passed


def test_no_number_passes_nothing():
    assert not check("a/b", "a statement", [], 1.0, 0.2).passed


def test_json_has_six_keys_and_no_nan():
    record = check("a/b", "a statement", [1.0, math.nan], [1.0, 2.0], 0.5).as_json()
    assert record == {
        "id": "a/b",
        "statement": "a statement",
        "passed": False,
        "measured": [1.0, None],
        "expected": [1.0, 2.0],
        "tolerance": 0.5,
    }


@pytest.mark.parametrize("weighted", [False, True])
def test_a_slope_against_numpy(weighted: bool):
    random = np.random.default_rng(0)
    x, y = random.normal(size=(2, 9))
    errors = random.uniform(0.5, 2.0, size=9) if weighted else None
    weights = {"w": 1 / errors, "cov": "unscaled"} if weighted else {"cov": True}
    (slope, _), covariance = np.polyfit(x, y, 1, **weights)
    found = fitted_slope(x, y, errors)
    assert found.value == pytest.approx(slope)
    assert found.error == pytest.approx(np.sqrt(covariance[0, 0]))


def test_the_error_of_a_slope_is_that_of_repetition():
    random, x = np.random.default_rng(1), np.linspace(0, 1, 8)
    fits = [fitted_slope(x, 3 * x + random.normal(size=8), np.ones(8)) for _ in range(2000)]
    spread = np.std([fit.value for fit in fits])
    # The standard deviation of a standard deviation from 2000 numbers: 1 / sqrt(4000) of it.
    assert spread == pytest.approx(fits[0].error, rel=4 / np.sqrt(4000))


@pytest.mark.parametrize(("power", "step"), [(2, 2), (1, 1), (2, 4)])
def test_the_next_term_does_not_spoil_the_exponent(power: int, step: int):
    x = 0.1 * 0.5 ** np.arange(8)
    y = 3 * x**power * (1 + 0.7 * x**step + 0.5 * x ** (2 * step))
    with_it, without = fitted_power(x, y, next_term=step), fitted_power(x, y)
    assert abs(with_it.value - power) < 4 * with_it.error
    assert with_it.error < 0.1 * without.error


def test_what_is_no_power_has_no_exponent():
    assert math.isnan(fitted_power([1.0, 2.0, 3.0], [1.0, -1.0, 1.0]).value)
    assert not exponent("a/b", "nothing", Slope(math.nan, math.nan), 2.0).passed


def test_scatter_excuses_no_exponent():
    assert exponent("a/b", "so", Slope(2.05, 0.02), 2.0).passed
    assert not exponent("a/b", "so", Slope(2.2, 1.0), 2.0).passed


def test_small_helpers():
    assert relative_error([3.0, 4.0], [0.0, 4.0]) == pytest.approx(0.75)
    assert rounding(10) == pytest.approx(1000 * 2**-52)
    assert [row.y for row in guide("x", "y", "x^2", [1, 2], 8.0, 2.0)] == [2.0, 8.0]
    assert points("x", "y", "z", [1, 2], [3, 4])[1] == ("x", "y", "z", 2.0, 4.0, 0.0)
