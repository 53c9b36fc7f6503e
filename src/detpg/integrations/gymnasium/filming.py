"""What any world draws of itself, as red, green and blue from 0 to 255."""

import math
import numbers
from typing import Any, NoReturn

import numpy as np

from detpg.integrations.gymnasium.parts import RENDER_FPS

SLOWEST, FASTEST = 0.01, 1000.0  # frames a second that a film can have
ROUNDING = 1e-3  # of white: what a number may be beyond it, or below black
FITTING = "let render() return uint8 of shape (height, width, 3)"


def frame_rate(metadata: Any) -> float:
    """Frames a second, as a world's `render_fps` says; RENDER_FPS where that is no such number."""
    told = metadata.get("render_fps") if isinstance(metadata, dict) else None
    if not isinstance(told, numbers.Real) or isinstance(told, bool | np.bool):
        return RENDER_FPS
    rate = float(told)
    if not math.isfinite(rate) or rate <= 0:
        return RENDER_FPS
    return min(max(rate, SLOWEST), FASTEST)


class Film:
    """An episode's frames, converted as they come.

    Taken are uint8; floats in 0 to 1 or in 0 to 255; integers in 0 to 255, uint16 also in 0 to
    65535; booleans. In any of these grey (height, width) or (height, width, 1), red, green and
    blue, or those with an opacity, which is laid over white; channels last or first. Of a list of
    frames the last is taken: the others were drawn before it.

    Attributes:
        frames: uint8, shape (height, width, 3); sizes may differ.
        rate: Frames a second.
    """

    def __init__(self, name: str, rate: float):
        """Begins without frames.

        Args:
            name: Of the world, for what is said.
            rate: Frames a second.
        """
        self.frames: list[np.ndarray] = []
        self.rate, self._name = rate, name
        self._white: dict[str, float] = {}  # kind of dtype -> what stands for white

    def add(self, drawn: Any) -> None:
        """Takes what `render` returned.

        Raises:
            ValueError: It is no picture, or not of the kind of those before it.
        """
        levels = self._levels(self._channels_last(self._array(drawn)))
        colours, opacity = levels[..., :3], levels[..., 3:]
        if levels.shape[-1] == 4:
            over_white = colours * opacity.astype(np.float32) + 255.0 * (255 - opacity)
            colours = np.rint(over_white / 255).astype(np.uint8)
        # A copy: many worlds draw into the same memory again.
        self.frames.append(np.array(np.broadcast_to(colours, (*colours.shape[:2], 3)), order="C"))

    def _array(self, drawn: Any) -> np.ndarray:
        if isinstance(drawn, list | tuple) and (not drawn or not isinstance(drawn[-1], list)):
            drawn = drawn[-1] if drawn else None
        if drawn is None and not self.frames:
            raise ValueError(f"{self._name} draws no picture: nothing can be filmed.")
        try:
            found = np.asarray(drawn)
        except Exception:  # somebody else's code makes the array, and may fail in any way
            found = np.asarray(None)
        if found.dtype.kind not in "biuf":
            self._refuse(f"is a {type(drawn).__name__}")
        return found[-1] if found.ndim == 4 and len(found) else found

    def _channels_last(self, found: np.ndarray) -> np.ndarray:
        channels = (1, 3, 4)
        shape = found.shape
        if found.ndim == 2:
            found = found[..., None]
        elif found.ndim == 3 and shape[-1] not in channels and shape[0] in channels:
            found = np.moveaxis(found, 0, -1)
        if found.ndim != 3 or found.shape[-1] not in channels or found.size == 0:
            self._refuse(f"has shape {shape}")
        return found

    def _levels(self, found: np.ndarray) -> np.ndarray:
        """Numbers from 0 to 255."""
        if found.dtype == np.uint8:
            return found
        if found.dtype.kind == "b":
            return np.where(found, np.uint8(255), np.uint8(0))
        low, high = float(found.min()), float(found.max())
        if not (math.isfinite(low) and math.isfinite(high)):
            self._refuse("has numbers that are not finite")
        white = self._white_of(found.dtype, low, high)
        levels = np.rint(found.astype(np.float32) * np.float32(255 / white))
        return np.clip(levels, 0, 255).astype(np.uint8)

    def _white_of(self, dtype: np.dtype, low: float, high: float) -> float:
        """What stands for white: one number for a film, or a dark frame would shine."""
        known = self._white.get(dtype.kind)
        fit = [
            white
            for least, white in _scales(dtype)
            if low >= -ROUNDING * white and high <= (1 + ROUNDING) * white
            if white == known or (known is None and (high >= least or high <= 0))
        ]
        if not fit:
            before = "" if known is None else f", those before it from 0 to {known:g}"
            self._refuse(f"has numbers from {low:g} to {high:g}{before}")
        if high > 0:
            self._white[dtype.kind] = fit[0]
        return fit[0]

    def _refuse(self, what: str) -> NoReturn:
        raise ValueError(f"Frame {len(self.frames)} of {self._name} {what}: {FITTING}.")


def _scales(dtype: np.dtype) -> list[tuple[float, float]]:
    """What the brightest number must reach -> what stands for white.

    Floats between the two scales are on neither: the film would be black.
    """
    if dtype.kind == "f":
        return [(0.0, 1.0), (2.0, 255.0)]
    return [(0.0, 255.0), (256.0, 65535.0)] if dtype == np.uint16 else [(0.0, 255.0)]
