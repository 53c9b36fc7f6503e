import dataclasses
import math
import re
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

from detpg.algorithms import ALGORITHMS
from detpg.checks import check_choices
from detpg.types import (
    Hyper,
    Width,
    check_hyper,
    hyper,
    hyper_parameters,
    strong,
    switch,
    switches,
)


class Record(eqx.Module):
    size: int = eqx.field(static=True, default=2)
    alpha: jax.Array = hyper("step size", 0.5, 0.0, 2.0)
    sigma: jax.Array = hyper("width", 1.0, 1e-3, 3.0)

    def __check_init__(self):
        check_hyper(self)


def test_hyper_parameters_are_leaves_in_order_of_declaration_with_their_records():
    assert hyper_parameters(Record) == {
        "alpha": Hyper("step size", 0.5, 0.0, 2.0),
        "sigma": Hyper("width", 1.0, 1e-3, 3.0),
    }
    assert [float(leaf) for leaf in jax.tree.leaves(Record(sigma=2.0))] == [0.5, 2.0]


class Switched(eqx.Module):
    kept: bool = switch("keep it", False)
    batch: int = switch("transitions of an update", 128)
    form: Literal["plain", "scaled"] = switch("of the gradient", "plain")

    def __check_init__(self):
        check_choices(self)


def test_switches_are_static_and_say_what_they_do():
    found = {n: (f.type, f.default, f.metadata["switch"]) for n, f in switches(Switched).items()}
    assert found == {
        "kept": (bool, False, "keep it"),
        "batch": (int, 128, "transitions of an update"),
        "form": (Literal["plain", "scaled"], "plain", "of the gradient"),
    }
    assert jax.tree.leaves(Switched(batch=3)) == []
    assert switches(Switched(kept=True)).keys() == switches(Switched).keys()


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ({"kept": 1}, "kept 1 is unknown: choose one of True, False."),
        ({"batch": 2.5}, "batch = 2.5 is no whole number: give one, such as 10."),
        ({"batch": True}, "batch = True is no whole number: give one, such as 10."),
        ({"form": "both"}, "form 'both' is unknown: choose one of plain, scaled."),
    ],
)
def test_a_switch_that_cannot_be_is_refused(option, words):
    with pytest.raises(ValueError, match=f"^{re.escape(words)}$"):
        Switched(**option)


@pytest.mark.parametrize("name", ALGORITHMS)
def test_every_static_option_of_an_algorithm_is_a_switch_that_says_what_it_does(name):
    kind = ALGORITHMS[name]
    options = {f.name for f in dataclasses.fields(kind) if f.metadata.get("static")}
    parts = {"policy", "action_value", "action_values", "state_value", "features", "noise"}
    parts |= {"bounds", "action_size"}
    assert options - parts == set(switches(kind))
    assert all(len(field.metadata["switch"]) > 5 for field in switches(kind).values())


@pytest.mark.parametrize("value", [0.25, 1, jnp.asarray(0.25), jnp.asarray(1)])
def test_strong_gives_floats_that_are_not_weakly_typed(value):
    converted = strong(value)
    assert converted.dtype == jnp.float32
    assert not converted.weak_type
    assert float(converted) == float(value)


@pytest.mark.usefixtures("x64")
def test_strong_keeps_the_precision_of_an_array():
    assert strong(jnp.asarray(0.1, dtype=jnp.float32)).dtype == jnp.float32
    assert strong(0.1).dtype == jnp.float64


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, -0.1, 2.1])
def test_a_hyper_parameter_out_of_range_is_refused_in_one_sentence(bad):
    with pytest.raises(ValueError, match=r"^alpha = .* between 0 and 2 \(step size\)\.$"):
        Record(alpha=bad)


@pytest.mark.parametrize("edge", [0.0, 2.0])
def test_the_ends_of_the_range_are_allowed(edge):
    assert float(Record(alpha=edge).alpha) == edge


def test_infinity_is_refused_even_where_nothing_bounds_the_range():
    class Unbounded(Record):
        scale: jax.Array = hyper("scale", 1.0, 0.0, math.inf)

    assert float(Unbounded(scale=1e30).scale) > 1e29
    with pytest.raises(ValueError, match="scale = inf is not usable"):
        Unbounded(scale=math.inf)


class Wide(Record):
    sigma: Width = hyper("width", 1.0, 1e-3, 3.0)


def test_one_bad_width_among_good_ones_is_refused():
    assert Wide(sigma=jnp.asarray([1.0, 2.0])).sigma.shape == (2,)
    with pytest.raises(ValueError, match="sigma = 0 is not usable"):
        Wide(sigma=jnp.asarray([1.0, 0.0]))


def test_only_a_width_may_be_a_vector():
    with pytest.raises(ValueError, match=r"^alpha has shape \(2,\): give one number .*\.$"):
        Wide(alpha=jnp.asarray([1.0, 2.0]))
    with pytest.raises(ValueError, match=r"^sigma has shape \(1, 2\): give one number for each"):
        Wide(sigma=jnp.asarray([[1.0, 2.0]]))
    with pytest.raises(ValueError, match=r"^alpha has shape \(2,\)"):
        jax.jit(lambda alpha: Record(alpha=alpha).alpha)(jnp.ones(2))


def test_traced_values_pass():
    doubled = jax.vmap(lambda alpha: Record(alpha=alpha).alpha * 2)(jnp.asarray([1.0, 9.0]))
    assert doubled.tolist() == [2.0, 18.0]
