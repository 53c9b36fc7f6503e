"""mu_theta as any differentiable function: one's own controller, Equinox and Flax modules.

A policy is a static part of a learner, which JAX hashes and compares to find what it has compiled.
Here that goes by value, first parameters included, so that an equal policy made anew is the same
program. Functions compare as Python compares them: a named one, or a frozen record that can be
called, is equal to itself; a lambda written anew is a new function.
"""

import dataclasses
from collections.abc import Callable
from types import MethodType
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import PRNGKeyArray, PyTree

from detpg.types import Action, Observation


@dataclasses.dataclass(frozen=True)
class Constant:
    """An array by value: its bytes can be hashed, and nobody can change them."""

    dtype: str
    shape: tuple[int, ...]
    content: bytes

    def array(self) -> np.ndarray:
        """The array again."""
        return np.frombuffer(self.content, np.dtype(self.dtype)).reshape(self.shape)


@dataclasses.dataclass(frozen=True)
class Constants:
    """A tree by value: arrays as `Constant`, all else as it is."""

    structure: Any
    leaves: tuple[Any, ...]

    @classmethod
    def of(cls, tree: PyTree) -> "Constants":
        """Takes a copy of every array.

        Raises:
            ValueError: A leaf that is being traced has no value yet.
        """
        leaves, structure = jax.tree.flatten(tree)
        if any(isinstance(leaf, Tracer) for leaf in leaves):
            raise ValueError(
                "The parameters of a policy are being traced by jit, vmap or grad, so that they "
                "have no value yet: give a function key -> parameters or NumPy arrays, or make the "
                "policy outside."
            )
        return cls(structure, tuple(map(_constant, leaves)))

    def tree(self) -> PyTree:
        """The tree again."""
        leaves = [leaf.array() if isinstance(leaf, Constant) else leaf for leaf in self.leaves]
        return jax.tree.unflatten(self.structure, leaves)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled as the tree: a module's structure alone would come back as another one."""
        return Constants.of, (self.tree(),)


@dataclasses.dataclass(frozen=True)
class Method:
    """A bound method by the value of its owner; Python's own compare the owner's identity.

    Attributes:
        function: As defined in the class.
        owner: What it is bound to.
    """

    function: Callable[..., Any]
    owner: Any

    def __call__(self, *inputs: Any) -> Any:
        return self.function(self.owner, *inputs)


@dataclasses.dataclass(frozen=True, init=False)
class FunctionPolicy:
    """mu_theta(s) = function(theta, s), any differentiable function of any tree of floats.

    Attributes:
        function: (theta, observation) -> action, a vector with one number for each component.
        initial: Where theta starts: a function key -> parameters, or the parameters by value.
    """

    function: Callable[..., Any]
    initial: Callable[..., Any] | Constants

    def __init__(self, function: Callable[..., Any], initial: Any):
        """Takes the function and its first parameters, or a function key -> parameters.

        Raises:
            ValueError: No function, or parameters that are no floats.
        """
        if not callable(function):
            raise ValueError(
                f"{function!r} cannot be called: give a function (theta, observation) -> action."
            )
        # A module can be called too, but is a tree of parameters.
        drawn = callable(initial) and jax.tree_util.all_leaves([initial])
        object.__setattr__(self, "function", _by_value(function))
        object.__setattr__(self, "initial", _by_value(initial) if drawn else _floats(initial))
        _check_hash(self)

    def init(self, key: PRNGKeyArray) -> PyTree:
        """The first parameters; given ones become arrays of the default float.

        Raises:
            ValueError: The function key -> parameters gave something else than floats.
        """
        if isinstance(self.initial, Constants):
            return jax.tree.map(lambda x: jnp.asarray(x, dtype=float), self.initial.tree())
        theta = self.initial(key)
        _check_floats(theta)
        return theta

    def __call__(self, theta: PyTree, observation: Observation) -> Action:
        return self.function(theta, observation)

    def __deepcopy__(self, memo: dict[int, Any]) -> "FunctionPolicy":
        """A value is its own copy; copied jitted functions would be unlike themselves."""
        return self


@dataclasses.dataclass(frozen=True)
class EquinoxFunction:
    """An Equinox module whose float arrays are theta.

    Attributes:
        rest: The module without them.
    """

    rest: Constants

    def __call__(self, theta: PyTree, observation: Observation) -> Action:
        return eqx.combine(theta, self.rest.tree())(observation)


@dataclasses.dataclass(frozen=True)
class FlaxFunction:
    """A Flax module, applied to its collection "params".

    Attributes:
        module: Anything with Flax's `init(key, observation)` and `apply(variables, observation)`.
    """

    module: Any

    def __call__(self, theta: PyTree, observation: Observation) -> Action:
        return self.module.apply({"params": theta}, observation)

    def __hash__(self) -> int:
        """Of its class: a module that holds a list of layers has no hash, but can be compared."""
        return hash(type(self.module))


@dataclasses.dataclass(frozen=True)
class FlaxInitial:
    """The first parameters of a Flax module.

    Attributes:
        function: The module.
        observation_size: d.
    """

    function: FlaxFunction
    observation_size: int

    def __call__(self, key: PRNGKeyArray) -> PyTree:
        variables = self.function.module.init(key, jnp.zeros(self.observation_size))
        others = ", ".join(name for name in variables if name != "params")
        if others:
            raise ValueError(
                f"The Flax module keeps {others} besides its parameters, which a policy has no "
                "place for: leave out layers with running statistics, such as BatchNorm."
            )
        return variables["params"]


def from_equinox(module: Any) -> FunctionPolicy:
    """The policy of an Equinox module `module(observation) -> action`.

    Its arrays of floats are theta and start where they are; integers, booleans, functions and
    Python numbers stay in the function.

    Raises:
        ValueError: A module without an array of floats.
    """
    theta, rest = eqx.partition(module, eqx.is_inexact_array)
    if not jax.tree.leaves(theta):
        raise ValueError(
            f"The module {type(module).__name__} holds no array of floats, so there is nothing to "
            "learn: make its numbers arrays, as jnp.asarray(1.0)."
        )
    return FunctionPolicy(EquinoxFunction(Constants.of(rest)), theta)


def from_flax(module: Any, observation_size: int) -> FunctionPolicy:
    """The policy of a Flax (linen) module `module(observation) -> action`.

    theta is its collection "params" and is drawn by the module's own initialisers.

    Args:
        module: Anything with Flax's `init(key, observation)` and `apply(variables, observation)`.
        observation_size: d.

    Raises:
        ValueError: Something without the two.
    """
    if not (callable(getattr(module, "init", None)) and callable(getattr(module, "apply", None))):
        raise ValueError(
            f"{type(module).__name__} has no init and apply as flax.linen's modules do: give one "
            "of those, or write FunctionPolicy(function, initial)."
        )
    function = FlaxFunction(module)
    return FunctionPolicy(function, FlaxInitial(function, observation_size))


def _by_value(function: Callable[..., Any]) -> Callable[..., Any]:
    if isinstance(function, MethodType):
        return Method(function.__func__, function.__self__)
    return function


def _constant(leaf: Any) -> Any:
    if not isinstance(leaf, (np.ndarray, np.generic, jax.Array)):
        return leaf
    array = np.asarray(leaf)
    return Constant(array.dtype.name, array.shape, array.tobytes())


def _floats(theta: PyTree) -> Constants:
    """Of parameters that were given: in double precision, so that equal numbers are equal."""
    _check_floats(theta)
    kept = Constants.of(theta)
    return Constants.of(jax.tree.map(lambda x: np.asarray(x, np.float64), kept.tree()))


def _check_hash(policy: FunctionPolicy) -> None:
    """Refuses what JAX could not keep a compiled program under.

    Raises:
        ValueError: Names the type that has no hash.
    """
    try:
        hash(policy)
    except TypeError as error:
        raise ValueError(
            f"The policy's function, a {type(policy.function).__name__}, holds something without a "
            f"hash ({error}): give a named function or a frozen dataclass, and an Equinox module "
            "through from_equinox."
        ) from error


def _check_floats(theta: PyTree) -> None:
    """Refuses leaves along which there is no gradient.

    Raises:
        ValueError: Names the leaf and its type.
    """
    leaves = jax.tree_util.tree_leaves_with_path(theta)
    if not leaves:
        raise ValueError("theta has no leaves, so there is nothing to learn: give it floats.")
    for path, leaf in leaves:
        dtype = getattr(leaf, "dtype", np.dtype(float) if type(leaf) is float else None)
        if dtype is None or not jnp.issubdtype(dtype, jnp.floating):
            kind = type(leaf).__name__ if dtype is None else dtype
            raise ValueError(
                f"theta{jax.tree_util.keystr(path)} is of type {kind}, but only floats have a "
                "gradient: write 1.0 for 1, and keep what is not learnt in the function."
            )
