import jax
import jax.numpy as jnp
import numpy as np

from detpg import trees
from detpg.policies import ConstantPolicy, IsotropicGaussian

TREE = {"a": jnp.asarray([1.0, 2.0]), "b": jnp.asarray([[3.0], [4.0]])}


def test_add_scaled_takes_one_step():
    direction = {"a": jnp.asarray([1.0, 0.0]), "b": jnp.asarray([[0.0], [-1.0]])}
    moved = trees.add_scaled(TREE, jnp.asarray(10.0), direction)
    assert moved["a"].tolist() == [11.0, 2.0]
    assert moved["b"].tolist() == [[3.0], [-6.0]]


def test_where_chooses_whole_trees():
    other = jax.tree.map(lambda x: -x, TREE)
    for condition, chosen in ((True, TREE), (False, other)):
        found = trees.where(jnp.asarray(condition), TREE, other)
        assert jax.tree.all(jax.tree.map(jnp.array_equal, found, chosen))


def test_mean_is_over_the_leading_axis():
    stacked = {"a": jnp.asarray([[1.0, 2.0], [3.0, 6.0]])}
    assert trees.mean(stacked)["a"].tolist() == [2.0, 4.0]


def test_a_vector_lists_the_leaves_in_order_and_goes_back():
    vector = trees.to_vector(TREE)
    assert vector.tolist() == [1.0, 2.0, 3.0, 4.0]
    back = trees.like(TREE, 2 * vector)
    assert jax.tree.structure(back) == jax.tree.structure(TREE)
    assert back["a"].tolist() == [2.0, 4.0]
    np.testing.assert_array_equal(back["b"], [[6.0], [8.0]])


def test_num_parameters_counts_every_leaf():
    assert trees.num_parameters(ConstantPolicy(7)) == 7
    assert trees.num_parameters(IsotropicGaussian(ConstantPolicy(7))) == 8


def test_dot_runs_over_every_leaf():
    other = {"a": jnp.asarray([1.0, 10.0]), "b": jnp.asarray([[2.0], [3.0]])}
    one = {"a": jnp.asarray([5.0, 7.0]), "b": jnp.asarray([[1.0], [-1.0]])}
    assert float(trees.dot(one, other)) == 5 + 70 + 2 - 3


def test_zeros_like_keeps_shapes_and_dtypes():
    zeros = trees.zeros_like(TREE)
    assert jax.tree.map(lambda x: (x.shape, x.dtype), zeros) == jax.tree.map(
        lambda x: (x.shape, x.dtype), TREE
    )
    assert not np.any(trees.to_vector(zeros))
