"""The octopus arm's primitive actions."""

import numpy as np
from jaxtyping import Array, Float

from detpg.types import strong


def primitives(num_segments: int) -> Float[Array, "8 act"]:
    """The primitives of the Java simulators: a torque, or a muscle group fully on in half the arm.

    The base counter-clockwise, clockwise; dorsal, transversal, ventral in the half at the base; the
    same in the half at the tip, to which the middle one of an odd number of segments belongs.
    """
    actions = np.zeros((8, 2 + 3 * num_segments))
    muscles = actions[:, 2:].reshape(8, num_segments, 3)
    half = num_segments // 2
    for i in range(3):
        muscles[2 + i, :half, i] = muscles[5 + i, half:, i] = 1
    actions[0, 0] = actions[1, 1] = 1
    return strong(actions)
