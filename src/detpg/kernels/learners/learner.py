"""What a learner gives to the compiled loop, and the sums that all of them are made of."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from detpg.checks import check_options
from detpg.kernels.compiling import piece
from detpg.types import hyper_parameters


@dataclasses.dataclass(frozen=True)
class Learner:
    """An algorithm of `detpg.algorithms` on tile-coded features, as compiled functions.

    The functions read their hyper-parameters from one array: the numbers of `hyper`, then 1 or 0
    for each of `switches`.

    Attributes:
        algorithm: What is specialised: the definition, and the source of defaults and ranges.
        hyper: Hyper-parameters, in the order in which the functions read them.
        switches: Structural options, with the value that stands for 1.
        vectors: The learnt vectors and traces, each with whether there is one for every action
            component; the weights of the mean policy come first.
        behave: (weights, active, hyper, mean, width): writes mean and standard deviation of the
            action.
        learn: (weights, active, next_active, deviation, width, reward, terminated, ended, hyper):
            one update, `deviation` the action less its mean; may overwrite `width`.
    """

    algorithm: type[Any]
    hyper: tuple[str, ...]
    switches: tuple[tuple[str, Any], ...]
    vectors: tuple[tuple[str, bool], ...]
    behave: Callable[..., Any]
    learn: Callable[..., Any]

    def num_vectors(self, action_size: int) -> int:
        """Rows of the array of weights."""
        return sum(action_size if each else 1 for _, each in self.vectors)

    def named(self, weights: np.ndarray, action_size: int) -> dict[str, np.ndarray]:
        """The rows of the array of weights, by name."""
        found, row = {}, 0
        for name, each in self.vectors:
            found[name] = weights[row : row + action_size] if each else weights[row]
            row += action_size if each else 1
        return found

    def points(
        self, numbers: Mapping[str, Any], options: Mapping[str, Any], gamma: float
    ) -> np.ndarray:
        """One row of hyper-parameters and switches for each point.

        Args:
            numbers: One value, or one for each point, by name; the defaults of the algorithm for
                what is not named.
            options: Structural options by name.
            gamma: Discount factor where none is named.

        Raises:
            ValueError: A name that the learner does not read, a value out of its range, an option
                that the algorithm does not have, or columns that do not fit.
        """
        unknown = [name for name in numbers if name not in self.hyper]
        unknown += [name for name in options if name not in dict(self.switches)]
        if unknown:
            known = ", ".join((*self.hyper, *dict(self.switches)))
            raise ValueError(f"{', '.join(unknown)} cannot be set here: choose from {known}.")
        check_options(self.algorithm, options)
        declared = hyper_parameters(self.algorithm)
        defaults = {name: declared[name].default for name in self.hyper} | {"gamma": gamma}
        columns = [np.atleast_1d(np.float64((defaults | dict(numbers))[n])) for n in self.hyper]
        _check_lengths(dict(zip(self.hyper, columns, strict=True)))
        for name, column in zip(self.hyper, columns, strict=True):
            known = declared[name]
            for value in column[~((column >= known.low) & (column <= known.high))][:1]:
                raise ValueError(
                    f"{name} = {value:g} is not usable: give a finite number between "
                    f"{known.low:g} and {known.high:g} ({known.doc})."
                )
        flags = [np.array([float(options.get(n) == on)]) for n, on in self.switches]
        return np.stack(np.broadcast_arrays(*columns, *flags), axis=1)


def _check_lengths(columns: Mapping[str, np.ndarray]) -> None:
    many = {name: column.shape for name, column in columns.items() if column.shape != (1,)}
    if len(set(many.values())) > 1 or any(len(s) > 1 or 0 in s for s in many.values()):
        shapes = ", ".join(f"{name} {shape}" for name, shape in many.items())
        raise ValueError(
            f"The hyper-parameters have shapes that do not fit, {shapes}: give one number, or one "
            "for each point."
        )


@piece
def dot(weights, row, active):
    """weights[row]^T x."""
    total = weights.dtype.type(0)
    for i in active:
        total += weights[row, i]
    return total


@piece
def dot_vector(weights, row, other):
    """weights[row]^T weights[other]."""
    total = weights.dtype.type(0)
    for i in range(weights.shape[1]):
        total += weights[row, i] * weights[other, i]
    return total


@piece
def add(weights, row, active, amount):
    """weights[row] <- weights[row] + amount x."""
    for i in active:
        weights[row, i] += amount


@piece
def add_vector(weights, row, amount, other):
    """weights[row] <- weights[row] + amount weights[other]."""
    for i in range(weights.shape[1]):
        weights[row, i] += amount * weights[other, i]
