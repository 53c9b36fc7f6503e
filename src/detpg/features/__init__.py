"""Stop 3: what the critic is linear in, phi(s, a) or phi(s).

In: an observation, and for compatible features an action and the policy. Out: features.
Next: a critic weighs them (`detpg.critics`).
"""

from detpg.features.compatible import compatible_features, score
from detpg.features.quadratic import QuadraticFeatures
from detpg.features.tile_coding import TileCoding, divided

__all__ = ["QuadraticFeatures", "TileCoding", "compatible_features", "divided", "score"]
