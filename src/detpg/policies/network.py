"""mu_theta as a ReLU network, inside the box where the actions have one."""

import dataclasses
from typing import Literal

import jax.numpy as jnp
from jaxtyping import PRNGKeyArray, PyTree

from detpg.networks import Network, Norm
from detpg.types import Action, Observation


@dataclasses.dataclass(frozen=True)
class NetworkPolicy:
    """ReLU layers and a tanh: the actor of DDPG and TD3; theta is a list of layers.

    Attributes:
        observation_size: d.
        action_size: m.
        hidden: Units of each hidden layer.
        norm: Where LayerNorm stands, as in `networks.Network`.
        output: "tanh" for actions in [-1, 1], "linear" where a component has no bound.
        output_width: Of the output weights at the start; small, so that no action saturates.
    """

    observation_size: int
    action_size: int
    hidden: tuple[int, ...] = (128, 128)
    norm: Norm = "none"
    output: Literal["tanh", "linear"] = "tanh"
    output_width: float = 0.01

    @property
    def _network(self) -> Network:
        sizes = self.observation_size, self.hidden, self.action_size
        return Network(*sizes, self.norm, self.output_width)

    def init(self, key: PRNGKeyArray) -> PyTree:
        """Actions near the middle of the box."""
        return self._network.init(key)

    def __call__(self, theta: PyTree, observation: Observation) -> Action:
        output = self._network(theta, observation)
        return jnp.tanh(output) if self.output == "tanh" else output
