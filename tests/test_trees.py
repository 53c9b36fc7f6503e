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


def test_one_number_that_is_not_finite_is_found():
    assert bool(trees.all_finite(TREE))
    for bad in (jnp.nan, jnp.inf):
        assert not bool(trees.all_finite({**TREE, "b": TREE["b"].at[1, 0].set(bad)}))
