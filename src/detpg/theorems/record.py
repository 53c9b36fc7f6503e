"""What a check is: a statement, what was measured, what it must be, and within what."""

import dataclasses
import math
from collections.abc import Iterable
from typing import Any, Literal, NamedTuple

import numpy as np

Relation = Literal["within", "at least", "at most"]
SIGMAS = 4.0  # standard errors that a measured number may be off
WIDEST = 0.1  # that a fitted exponent may be off, however wide its standard error
EPSILON = float(np.finfo(np.float64).eps)


@dataclasses.dataclass(frozen=True)
class Check:
    """One statement, judged by one rule.

    "within": every measured number lies within its tolerance of the expected one. "at least": every
    measured number, less its tolerance, is above the expected one; "at most": plus its tolerance,
    below. A number, bound or tolerance that is not finite fails, and so does having none.

    Attributes:
        id: Stable name, slash-separated, that of its group first.
        statement: What must hold, in one sentence.
        measured: One number, or a few.
        expected: What they must be; as many, or one for all.
        tolerance: A multiple of a standard error, or of rounding; as many, or one for all.
        relation: Which of the three rules.
    """

    id: str
    statement: str
    measured: tuple[float, ...]
    expected: tuple[float, ...]
    tolerance: tuple[float, ...]
    relation: Relation = "within"

    @property
    def passed(self) -> bool:
        """Whether the rule holds for all numbers."""
        measured, expected, tolerance = np.broadcast_arrays(
            self.measured, self.expected, self.tolerance
        )
        holds = {
            "within": np.abs(measured - expected) <= tolerance,
            "at least": measured - tolerance >= expected,
            "at most": measured + tolerance <= expected,
        }[self.relation]
        finite = all(np.all(np.isfinite(x)) for x in (measured, expected, tolerance))
        return bool(measured.size > 0 and finite and np.all(holds))

    def as_json(self) -> dict[str, Any]:
        """JSON types: a single number stands alone, one that is not finite is null."""
        numbers = {name: getattr(self, name) for name in ("measured", "expected", "tolerance")}
        return {
            "id": self.id,
            "statement": self.statement,
            "passed": self.passed,
            **{name: _json(values) for name, values in numbers.items()},
        }


def _json(values: tuple[float, ...]) -> Any:
    finite = [value if math.isfinite(value) else None for value in values]
    return finite[0] if len(finite) == 1 else finite


def numbers(values: Any) -> tuple[float, ...]:
    """Any array as a flat tuple of Python numbers."""
    return tuple(float(value) for value in np.ravel(np.asarray(values)))


def check(
    id: str,
    statement: str,
    measured: Any,
    expected: Any,
    tolerance: Any,
    relation: Relation = "within",
) -> Check:
    """A check from arrays of any kind."""
    return Check(id, statement, numbers(measured), numbers(expected), numbers(tolerance), relation)


class Point(NamedTuple):
    """One row of the table behind the pictures, self-explaining.

    Attributes:
        x_name: What x is, with its unit; (x_name, y_name) is one panel.
        y_name: What y is.
        series: Which line of the panel.
        x: Abscissa.
        y: Ordinate.
        error: Standard error of y; 0 where y is exact.
    """

    x_name: str
    y_name: str
    series: str
    x: float
    y: float
    error: float


def points(
    x_name: str, y_name: str, series: str, x: Iterable[Any], y: Any, error: Any = 0.0
) -> tuple[Point, ...]:
    """One line of a panel."""
    xs, ys, errors = np.broadcast_arrays(np.asarray(list(x), dtype=float), y, error)
    rows = zip(numbers(xs), numbers(ys), numbers(errors), strict=True)
    return tuple(Point(x_name, y_name, series, *row) for row in rows)


def guide(
    x_name: str, y_name: str, words: str, x: Iterable[Any], y: Any, power: float
) -> tuple[Point, ...]:
    """A line to compare with: y at the last x, and x^power from there."""
    xs = np.asarray(list(x), dtype=float)
    return points(x_name, y_name, f"guide: {words}", xs, y * (xs / xs[-1]) ** power)


@dataclasses.dataclass(frozen=True)
class Group:
    """The checks of one theorem, and the points behind them.

    Attributes:
        title: For people.
        checks: Judged.
        points: Rows for the table and the picture.
    """

    title: str
    checks: tuple[Check, ...]
    points: tuple[Point, ...]


class Slope(NamedTuple):
    """A fitted slope and its standard error."""

    value: float
    error: float


def fitted_slope(x: Any, y: Any, errors: Any = None, beside: Any = None) -> Slope:
    """Straight line by least squares.

    Args:
        x: Abscissae.
        y: Ordinates.
        errors: Standard errors of independent y, which then weigh the points and give the slope's
            own; when not given, the scatter about the line does.
        beside: A further regressor, fitted with the line.
    """
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    columns = [x, np.ones_like(x)] + ([] if beside is None else [np.asarray(beside)])
    spread = np.ones_like(x) if errors is None else np.asarray(errors, dtype=np.float64)
    design = np.stack(columns, axis=1) / spread[:, None]
    weights = np.linalg.lstsq(design, y / spread)[0]
    variance = np.linalg.inv(design.T @ design)[0, 0]
    if errors is None:
        residual = y - design @ weights
        variance *= np.sum(residual**2) / (x.size - len(columns))
    return Slope(float(weights[0]), float(np.sqrt(variance)))


def fitted_power(x: Any, y: Any, errors: Any = None, next_term: int | None = None) -> Slope:
    """The exponent p of y ~ x^p: a straight line through the logarithms.

    Args:
        x: Positive.
        y: Positive.
        errors: Standard errors of y; when not given, y is exact but for higher powers of x.
        next_term: k of y ~ x^p (1 + c x^k + ...), fitted too: the curvature that it makes would
            else be taken for scatter, and the exponent be off by several of its standard errors.
    """
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if not np.all((y > 0) & np.isfinite(y)):
        return Slope(math.nan, math.nan)  # no power: a check of it fails
    relative = None if errors is None else np.asarray(errors, dtype=np.float64) / y
    beside = None if next_term is None else x**next_term
    return fitted_slope(np.log(x), np.log(y), relative, beside)


def exponent(id: str, statement: str, fitted: Slope, expected: float) -> Check:
    """A fitted exponent: within 4 standard errors, and never further off than 0.1.

    Where the points lie on no line at all, the scatter would else excuse any exponent.
    """
    tolerance = min(SIGMAS * fitted.error + rounding(1e3), WIDEST)
    return check(id, f"{statement}: fitted exponent", fitted.value, expected, tolerance)


def rounding(condition: Any = 1.0) -> float:
    """Relative error that double precision may leave: 100 roundings, times a condition number."""
    return 100 * EPSILON * float(condition)


def relative_error(measured: Any, exact: Any) -> float:
    """Norm of the difference over the norm of the exact one."""
    exact = np.ravel(np.asarray(exact))
    return float(np.linalg.norm(np.ravel(np.asarray(measured)) - exact) / np.linalg.norm(exact))
