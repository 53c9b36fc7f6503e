"""Any controller as a policy: by value where JAX hashes it, learnt by every learner that may."""

import copy
import dataclasses
import pickle
import subprocess
import sys

import equinox as eqx
import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.algorithms import ALGORITHMS
from detpg.environments import LQR
from detpg.policies import FunctionPolicy, LinearPolicy, from_equinox, from_flax
from detpg.testing import check_algorithm
from detpg.training import train
from toys import ShortLQR

KEY = jax.random.key(0)
LEARNERS = ("opdac", "dac", "copdac-q", "copdac-gq")
S = jnp.asarray([0.5, -1.0])


def pid(theta, observation):
    """A proportional and a derivative gain."""
    return -jnp.stack([theta["p"] * observation[0] + theta["d"] * observation[1]])


@dataclasses.dataclass(frozen=True)
class Squashed:
    """A controller as a record: equal by value."""

    limit: float

    def __call__(self, theta, observation):
        return self.limit * jnp.tanh(theta @ observation)


class Network(nn.Module):
    hidden: int = 4

    @nn.compact
    def __call__(self, observation):
        return nn.Dense(1)(nn.tanh(nn.Dense(self.hidden)(observation)))


class Offset(eqx.Module):
    """Arrays of floats are theta; the rest is not."""

    gain: jax.Array
    order: jax.Array
    scale: float
    sign: int = eqx.field(static=True, default=-1)

    def __call__(self, observation):
        return self.sign * self.scale * (self.gain @ observation[self.order])


def offset(scale=2.0, order=(1, 0), sign=-1):
    return Offset(jnp.asarray([[0.1, 0.2]]), jnp.asarray(order), scale, sign)


def mlp(seed=0):
    return eqx.nn.MLP(2, 1, 4, 1, activation=jnp.tanh, key=jax.random.key(seed))


MAKERS = {
    "gains": lambda: FunctionPolicy(pid, {"p": 0.5, "d": 0.1}),
    "drawn": lambda: FunctionPolicy(Squashed(2.0), LinearPolicy(2, 1).init),
    "equinox": lambda: from_equinox(mlp()),
    "flax": lambda: from_flax(Network(), 2),
    "flax with a list": lambda: from_flax(nn.Sequential([nn.Dense(3), nn.tanh, nn.Dense(1)]), 2),
}


PAIRS = [("opdac", "equinox"), ("dac", "gains"), ("copdac-q", "flax"), ("copdac-gq", "drawn")]


@pytest.mark.slow
@pytest.mark.parametrize(("learner", "name"), PAIRS)
def test_every_learner_takes_it(learner, name):
    """Under jit, vmap over seeds and hyper-parameters, saved and resumed."""
    world = ShortLQR()
    check_algorithm(ALGORITHMS[learner].create(world.spec, policy=MAKERS[name]()), world)


@pytest.mark.parametrize("name", MAKERS)
def test_one_made_anew_is_the_same_program(name):
    count = 0

    def run(algorithm):
        nonlocal count
        count += 1
        return train(algorithm, LQR(), KEY, 2)[0].learner

    compiled = jax.jit(run)
    for _ in range(3):
        compiled(ALGORITHMS["opdac"].create(LQR().spec, policy=MAKERS[name]()))
    assert count == 1


def test_another_start_function_or_static_part_is_another_policy():
    assert FunctionPolicy(pid, {"p": 0.5, "d": 0.1}) != FunctionPolicy(pid, {"p": 0.5, "d": 0.2})
    assert FunctionPolicy(Squashed(1.0), S) != FunctionPolicy(Squashed(2.0), S)
    different = [offset(), offset(scale=3.0), offset(order=(0, 1)), offset(sign=1)]
    assert len({from_equinox(module) for module in different}) == 4
    assert from_equinox(mlp(0)) != from_equinox(mlp(1))
    assert from_flax(Network(4), 2) != from_flax(Network(5), 2)
    layers = [nn.Sequential([nn.Dense(size)]) for size in (3, 4)]
    assert from_flax(layers[0], 2) != from_flax(layers[1], 2)


def test_what_is_given_is_copied():
    gains = {"p": np.asarray(0.5), "d": np.asarray(0.1)}
    policy = FunctionPolicy(pid, gains)
    gains["p"][...] = 9.0
    assert policy == FunctionPolicy(pid, {"p": 0.5, "d": 0.1})
    for again in (copy.deepcopy(policy), pickle.loads(pickle.dumps(policy))):
        assert (again, hash(again)) == (policy, hash(policy))


def test_only_arrays_of_floats_are_learnt():
    policy = from_equinox(offset())
    theta = policy.init(KEY)
    assert [leaf.shape for leaf in jax.tree.leaves(theta)] == [(1, 2)]
    # -2 (0.1 s_1 + 0.2 s_0), by hand
    np.testing.assert_allclose(policy(theta, S), [-2 * (0.1 * -1.0 + 0.2 * 0.5)], atol=1e-7)
    gradient = jax.grad(lambda theta: policy(theta, S)[0])(theta)
    np.testing.assert_allclose(gradient.gain, [[2.0, -1.0]])


def test_modules_are_what_they_were():
    theta = from_equinox(mlp()).init(KEY)
    np.testing.assert_array_equal(from_equinox(mlp())(theta, S), mlp()(S))
    variables = Network().init(KEY, S)
    policy = from_flax(Network(), 2)
    assert jax.tree.all(jax.tree.map(jnp.array_equal, policy.init(KEY), variables["params"]))
    np.testing.assert_array_equal(policy(policy.init(KEY), S), Network().apply(variables, S))


def test_given_parameters_are_strong_arrays_of_the_default_float(x64):
    policy = FunctionPolicy(pid, {"p": np.float32(0.5), "d": 0.1})
    for double in (True, False):
        with jax.enable_x64(double):
            leaves = jax.tree.leaves(policy.init(KEY))
            assert {leaf.dtype for leaf in leaves} == {jnp.zeros(()).dtype}
            assert not any(leaf.weak_type for leaf in leaves)


@pytest.mark.parametrize(
    ("initial", "said"),
    [
        ({"p": 1, "d": 0.0}, r"theta\['p'\] is of type int, but only floats"),
        ({"p": jnp.arange(2)}, r"theta\['p'\] is of type int32, but"),
        ([1.0, True], r"theta\[1\] is of type bool, but"),
        (lambda key: {"p": jnp.arange(2)}, r"theta\['p'\] is of type int32, but"),
        (mlp(), r"theta\.activation is of type \w+, but"),
        ({}, "theta has no leaves"),
    ],
)
def test_parameters_without_a_gradient_are_refused(initial, said):
    with pytest.raises(ValueError, match=rf"^{said}.*\.$"):
        FunctionPolicy(pid, initial).init(KEY)


def test_what_has_no_value_or_no_hash_is_refused():
    with pytest.raises(
        ValueError, match=r"^The parameters of a policy are being traced .* outside\."
    ):
        jax.vmap(lambda p: FunctionPolicy(pid, {"p": p}).init(KEY))(jnp.ones(2))
    with pytest.raises(ValueError, match=r"^The policy's function, a MLP, holds .*\.$"):
        FunctionPolicy(mlp(), {"p": 1.0})
    with pytest.raises(ValueError, match=r"^The module Identity holds no array of floats, .*\.$"):
        from_equinox(eqx.nn.Identity())


@pytest.mark.usefixtures("unchecked")
def test_what_is_no_function_or_module_is_refused():
    with pytest.raises(ValueError, match=r"^3 cannot be called: give a function .*\.$"):
        FunctionPolicy(3, {"p": 1.0})
    with pytest.raises(ValueError, match=r"^dict has no init and apply as flax\.linen's .*\.$"):
        from_flax({}, 2)


def test_running_statistics_are_refused():
    class Normed(nn.Module):
        @nn.compact
        def __call__(self, observation):
            return nn.Dense(1)(nn.BatchNorm(use_running_average=True)(observation))

    with pytest.raises(ValueError, match=r"^The Flax module keeps batch_stats besides .*\.$"):
        from_flax(Normed(), 2).init(KEY)


@pytest.mark.parametrize("learner", LEARNERS)
def test_one_for_another_number_of_actions_is_refused(learner):
    with pytest.raises(ValueError, match=r"^The policy's action has shape \(2,\), but \(1,\) is"):
        ALGORITHMS[learner].create(LQR().spec, policy=from_flax(nn.Dense(2), 2))


def test_the_library_does_not_import_flax():
    code = "import sys, detpg.policies; sys.exit('flax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
