"""Stop 2: the actor's function, mu_theta or pi_{theta,y}, and the behaviour beta.

In: an observation and parameters. Out: an action.
Next: the action goes to the world; its parameter gradient to the features (`detpg.features`).
"""

from detpg.policies.behaviour import GaussianBehaviour, cap
from detpg.policies.constant import ConstantPolicy
from detpg.policies.feature_gaussian import FeatureGaussian, MeanAndWidth
from detpg.policies.function import FunctionPolicy, from_equinox, from_flax
from detpg.policies.gaussian import GaussianParameters, IsotropicGaussian
from detpg.policies.linear import FeaturePolicy, LinearPolicy
from detpg.policies.mlp import MLPPolicy
from detpg.policies.network import NetworkPolicy
from detpg.policies.noise import ColouredNoise

__all__ = [
    "ColouredNoise",
    "ConstantPolicy",
    "FeatureGaussian",
    "FeaturePolicy",
    "FunctionPolicy",
    "GaussianBehaviour",
    "GaussianParameters",
    "IsotropicGaussian",
    "LinearPolicy",
    "MLPPolicy",
    "MeanAndWidth",
    "NetworkPolicy",
    "cap",
    "from_equinox",
    "from_flax",
]
