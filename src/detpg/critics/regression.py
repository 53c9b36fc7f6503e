"""The critic of the bandit: linear regression on one batch (Section 5.1)."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


class LinearFit(eqx.Module):
    """Q(a) = phi(a)^T w + bias.

    Attributes:
        w: Slope, one weight for each feature.
        bias: Weight of the bias feature.
    """

    w: Float[Array, "feat"]
    bias: Float[Array, ""]

    def __call__(self, features: Float[Array, "feat"]) -> Float[Array, ""]:
        return jnp.dot(features, self.w, precision="highest") + self.bias


def linear_regression(
    features: Float[Array, "batch feat"], targets: Float[Array, "batch"]
) -> LinearFit:
    """Least squares of targets on features and a bias feature (condition ii of Section 2.3).

    Features are centred, which takes the bias out of the system, and divided by their standard
    deviation: noise of width 0.001 would otherwise put 1e-6 beside 1 in the Gram matrix. The
    ridge is at rounding level; it keeps a batch with fewer rows than features solvable.

    Args:
        features: phi(s_i, a_i), one row per sample.
        targets: Rewards, or any estimate of Q.
    """
    num_rows, num_features = features.shape
    feature_mean, target_mean = jnp.mean(features, axis=0), jnp.mean(targets)
    centred = features - feature_mean[None, :]
    width = jnp.sqrt(jnp.mean(centred**2, axis=0))
    width = jnp.where(width > 0, width, jnp.ones_like(width))
    standard = centred / width[None, :]

    gram = jnp.dot(standard.T, standard, precision="highest") / num_rows
    moment = jnp.dot(standard.T, targets - target_mean, precision="highest") / num_rows
    ridge = num_rows * jnp.finfo(gram.dtype).eps * jnp.eye(num_features, dtype=gram.dtype)
    factor = jax.scipy.linalg.cho_factor(gram + ridge)
    w = jax.scipy.linalg.cho_solve(factor, moment) / width
    return LinearFit(w=w, bias=target_mean - jnp.dot(feature_mean, w, precision="highest"))
