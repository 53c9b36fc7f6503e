"""The continuous bandit of Section 5.1: a quadratic cost in m action dimensions."""

from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from detpg.types import Action, EnvironmentSpec, Number, Observation, strong

Spectrum = Literal["mixed", "isotropic"]
SPECTRA: tuple[Spectrum, ...] = ("mixed", "isotropic")


class QuadraticBandit(eqx.Module):
    """Quadratic bandit, `-r(a) = (a - a*)^T C (a - a*)` (Section 5.1).

    **Observation** (1 number)

    | index | quantity | unit | min | max |
    | --- | --- | --- | --- | --- |
    | 0 | constant 1: there is one state | none | 1 | 1 |

    **Action** (m numbers)

    | index | quantity | unit | min | max |
    | --- | --- | --- | --- | --- |
    | 0 ... m-1 | a | none | -inf | inf |

    **Dynamics.** None: an episode is one step.

    **Reward.** Minus the cost, in cost units; 0 at the best action, negative elsewhere. No noise.

    **Start.** The one state. **Termination.** After every action; the time limit is 1 step.

    **What the paper says, what we chose.** C is positive definite with eigenvalues from {0.1, 1},
    `a* = [4, ..., 4]`. The number of each eigenvalue and the eigenvectors are not said. `mixed`
    (the default) takes floor(m/2) eigenvalues 0.1 and the rest 1, rotated by a random orthogonal
    matrix (uniform over rotations and reflections); `isotropic` takes C = 0.1 I, the one reading
    found that fits the published curve for m = 50.

    **Version history.** 0: first version.

    Attributes:
        C: Cost matrix, positive definite, cost units per squared action unit.
        a_star: Action of least cost.
    """

    C: Float[Array, "act act"]
    a_star: Float[Array, "act"]

    def __init__(
        self,
        m: int = 10,
        spectrum: Spectrum = "mixed",
        *,
        key: PRNGKeyArray | None = None,
        C: Float[Array, "act act"] | None = None,
        a_star: Float[Array, "act"] | None = None,
    ):
        """Draws a bandit, or takes one's own.

        Args:
            m: Number of action dimensions.
            spectrum: Eigenvalues of C, "mixed" or "isotropic".
            key: Source of the random rotation; seed 0 when not given.
            C: Cost matrix to use instead of a drawn one; m and spectrum are then not read.
            a_star: Action of least cost; 4 in every dimension when not given.

        Raises:
            ValueError: m < 1, an unknown spectrum, or sizes that disagree.
        """
        if C is None:
            C = cost_matrix(jax.random.key(0) if key is None else key, m, spectrum)
        self.C = strong(C)
        self.a_star = strong([4.0] * len(self.C) if a_star is None else a_star)
        if self.a_star.ndim != 1 or self.C.shape != (self.a_star.size, self.a_star.size):
            raise ValueError(
                f"C has shape {self.C.shape} and a_star {self.a_star.shape}: "
                "C must be m by m and a_star of length m."
            )
        if not isinstance(self.C, Tracer):
            _check_definite(np.asarray(self.C))

    @property
    def spec(self) -> EnvironmentSpec:
        m = self.a_star.shape[0]
        unbounded = (float("inf"),) * m
        return EnvironmentSpec(
            name="bandit",
            observation_size=1,
            action_size=m,
            action_low=tuple(-high for high in unbounded),
            action_high=unbounded,
            time_limit=1,
            discount=1.0,
        )

    def initial(self, key: PRNGKeyArray) -> Bool[Array, ""]:
        """The state is whether the arm was pulled: at first it was not."""
        return jnp.asarray(False)

    def transition(
        self, key: PRNGKeyArray, state: Bool[Array, ""], action: Action
    ) -> Bool[Array, ""]:
        return jnp.asarray(True)

    def reward(self, state: Bool[Array, ""], action: Action, next_state: Bool[Array, ""]) -> Number:
        error = action - self.a_star
        return -jnp.dot(error, jnp.dot(self.C, error, precision="highest"), precision="highest")

    def terminated(self, state: Bool[Array, ""]) -> Bool[Array, ""]:
        return state

    def observe(self, state: Bool[Array, ""]) -> Observation:
        return jnp.ones(1, dtype=self.C.dtype)


def _check_definite(C: np.ndarray) -> None:
    eigenvalues = np.linalg.eigvalsh((C + C.T) / 2)
    if not (np.allclose(C, C.T, rtol=1e-4, atol=1e-6) and eigenvalues[0] > 0):
        raise ValueError(
            f"C is not symmetric and positive definite (least eigenvalue {eigenvalues[0]:g}): "
            "without that the cost has no least action."
        )


def cost_matrix(key: PRNGKeyArray, m: int, spectrum: Spectrum) -> Float[Array, "act act"]:
    """C of Section 5.1: positive definite, eigenvalues from {0.1, 1}, randomly rotated."""
    if m < 1:
        raise ValueError(f"m = {m} is not a number of action dimensions: give 1 or more.")
    if spectrum == "isotropic":
        return 0.1 * jnp.eye(m)
    if spectrum == "mixed":
        eigenvalues = jnp.where(jnp.arange(m) < m // 2, 0.1, 1.0)
        rotation = jax.random.orthogonal(key, m)
        return jnp.dot(rotation * eigenvalues[None, :], rotation.T, precision="highest")
    raise ValueError(f"spectrum {spectrum!r} is unknown: choose one of {', '.join(SPECTRA)}.")
