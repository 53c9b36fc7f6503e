"""K action values as one tensor of each layer: the twin critics of TD3."""

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from detpg.networks import Network, Norm
from detpg.types import Action, Observation


@dataclasses.dataclass(frozen=True)
class EnsembleActionValues:
    """Q_1 ... Q_K of (s, a), networks of one shape; each leaf of w has a leading axis K.

    Attributes:
        observation_size: d.
        action_size: m.
        hidden: Units of each hidden layer.
        norm: Where LayerNorm stands, as in `networks.Network`.
        size: K.
    """

    observation_size: int
    action_size: int
    hidden: tuple[int, ...] = (128, 128)
    norm: Norm = "first"
    size: int = 2

    @property
    def _network(self) -> Network:
        return Network(self.observation_size + self.action_size, self.hidden, 1, self.norm)

    def init(self, key: PRNGKeyArray) -> PyTree:
        """Networks that differ from the start."""
        return jax.vmap(self._network.init)(jax.random.split(key, self.size))

    def __call__(
        self, w: PyTree, observation: Observation, action: Action
    ) -> Float[Array, "critics"]:
        entries = jnp.concatenate([observation, action])
        return jax.vmap(self._network, in_axes=(0, None))(w, entries)[:, 0]

    def first(self, w: PyTree, observation: Observation, action: Action) -> Float[Array, ""]:
        """Q_1 alone, which costs 1 / K of all."""
        entries = jnp.concatenate([observation, action])
        return self._network(jax.tree.map(lambda leaf: leaf[0], w), entries)[0]
