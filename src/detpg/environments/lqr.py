"""The linear-quadratic regulator: the control problem whose values and gradients are known."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from detpg.types import Action, EnvironmentSpec, Number, Observation, strong

State = Float[Array, "obs"]


class LQR(eqx.Module):
    """Linear-quadratic regulator with Gaussian noise.

    **Observation** (d numbers): the state s, no unit, unbounded.

    **Action** (m numbers): a, no unit, unbounded.

    **Dynamics.** s' = A s + B a + noise * e, e standard normal.

    **Reward.** -(s^T Q s + a^T R a), of the state before the step. No noise.

    **Start.** s normal with mean 0 and covariance start^2 I. **Termination.** Never; the time limit
    is 200 steps.

    **What the paper says, what we chose.** The paper has no such task. It serves to check its
    theorems: with a = K s every quantity of Section 3 has a closed form. The default is a damped
    oscillator pushed by one force.

    **Version history.** 0: first version.

    Attributes:
        A: State transition.
        B: Effect of the action.
        Q: State cost, symmetric positive semidefinite.
        R: Action cost, symmetric positive definite.
        noise: Standard deviation of the noise in each state component.
        start: Standard deviation of the first state in each component.
        gamma: Discount factor (static).
    """

    A: Float[Array, "obs obs"]
    B: Float[Array, "obs act"]
    Q: Float[Array, "obs obs"]
    R: Float[Array, "act act"]
    noise: Number
    start: Number
    gamma: float = eqx.field(static=True)

    def __init__(
        self, A=None, B=None, Q=None, R=None, noise=0.1, start=1.0, gamma=0.9, *, key=None
    ):
        """Takes one's own matrices, or the default ones; `key` is not needed: nothing is random.

        Raises:
            ValueError: Sizes that disagree.
        """
        del key
        self.A = strong([[0.9, 0.2], [-0.2, 0.9]] if A is None else A)
        self.B = strong([[0.0], [0.5]] if B is None else B)
        self.Q = jnp.eye(len(self.A)) if Q is None else strong(Q)
        self.R = 0.5 * jnp.eye(self.B.shape[1]) if R is None else strong(R)
        self.noise, self.start, self.gamma = strong(noise), strong(start), gamma
        d, m = self.B.shape
        if (self.A.shape, self.Q.shape, self.R.shape) != ((d, d), (d, d), (m, m)):
            raise ValueError(
                f"A {self.A.shape}, B {self.B.shape}, Q {self.Q.shape} and R {self.R.shape} do not "
                "fit: with d states and m actions they are (d, d), (d, m), (d, d) and (m, m)."
            )

    @property
    def spec(self) -> EnvironmentSpec:
        d, m = self.B.shape
        infinite = (float("inf"),) * m
        return EnvironmentSpec("lqr", d, m, tuple(-x for x in infinite), infinite, 200, self.gamma)

    def initial(self, key: PRNGKeyArray) -> State:
        return self.start * jax.random.normal(key, (self.A.shape[0],), self.A.dtype)

    def transition(self, key: PRNGKeyArray, state: State, action: Action) -> State:
        disturbance = self.noise * jax.random.normal(key, state.shape, state.dtype)
        return _dot(self.A, state) + _dot(self.B, action) + disturbance

    def reward(self, state: State, action: Action, next_state: State) -> Number:
        return -(_dot(state, _dot(self.Q, state)) + _dot(action, _dot(self.R, action)))

    def terminated(self, state: State) -> Bool[Array, ""]:
        return jnp.asarray(False)

    def observe(self, state: State) -> Observation:
        return state

    def cost_to_go(self, K: Float[Array, "act obs"]) -> Float[Array, "obs obs"]:
        """P of V(s) = -(s^T P s + c): P = Q + K^T R K + gamma F^T P F with F = A + B K."""
        F = self.A + _dot(self.B, K)
        return _lyapunov(F.T, self.Q + _dot(K.T, _dot(self.R, K)), self.gamma)

    def value(self, K: Float[Array, "act obs"], state: State) -> Number:
        """V^mu(s) of mu(s) = K s, exact where gamma |eigenvalues of A + B K|^2 < 1."""
        P = self.cost_to_go(K)
        constant = self.gamma / (1 - self.gamma) * self.noise**2 * jnp.trace(P)
        return -(_dot(state, _dot(P, state)) + constant)

    def action_value(self, K: Float[Array, "act obs"], state: State, action: Action) -> Number:
        """Q^mu(s, a) of mu(s) = K s, exact."""
        expected = _dot(self.A, state) + _dot(self.B, action)
        spread = self.noise**2 * jnp.trace(self.cost_to_go(K))
        following = self.value(K, expected) - spread
        return self.reward(state, action, expected) + self.gamma * following

    def objective(self, K: Float[Array, "act obs"]) -> Number:
        """J(mu) = E[V^mu(s_1)] of mu(s) = K s, exact; differentiable in K."""
        spread = self.start**2 * jnp.trace(self.cost_to_go(K))
        return self.value(K, jnp.zeros_like(self.A[0])) - spread

    def state_moment(self, K: Float[Array, "act obs"]) -> Float[Array, "obs obs"]:
        """Second moment of the discounted state distribution rho^mu: sum_t gamma^t E[s_t s_t^T]."""
        identity = jnp.eye(self.A.shape[0], dtype=self.A.dtype)
        inflow = self.start**2 + self.gamma / (1 - self.gamma) * self.noise**2
        return _lyapunov(self.A + _dot(self.B, K), inflow * identity, self.gamma)


def _dot(a: Array, b: Array) -> Array:
    return jnp.dot(a, b, precision="highest")


def _lyapunov(F: Array, inflow: Array, gamma: float) -> Array:
    """The solution X of X = inflow + gamma F X F^T, as one linear system."""
    d = F.shape[0]
    system = jnp.eye(d * d, dtype=F.dtype) - gamma * jnp.kron(F, F)
    return jnp.linalg.solve(system, inflow.reshape(-1)).reshape(d, d)
