"""Films of pictures: mp4 or gif, at the pace and in the size of what was drawn."""

import importlib
import io
import math
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

import numpy as np

FASTEST_GIF = 50.0  # frames a second: viewers slow down what is faster
TICKS = 100  # a gif counts in hundredths of a second


def animate(
    frames: Iterable[np.ndarray], kind: Literal["mp4", "gif"] = "mp4", fps: float = 20
) -> bytes:
    """A film; smaller frames lie in the upper left corner of the largest ones' size.

    Args:
        frames: uint8, shape (height, width, 3).
        kind: mp4 needs the package imageio-ffmpeg.
        fps: Frames per second. Of a gif that is faster than FASTEST_GIF, some are left out.

    Raises:
        ValueError: No frames, or another kind.
        ModuleNotFoundError: mp4 without imageio-ffmpeg.
    """
    pictures = list(frames)
    if not pictures or kind not in ("mp4", "gif"):
        raise ValueError(f"{len(pictures)} frames as {kind!r}: give 1 or more, as mp4 or gif.")
    pictures = _of_one_size(pictures)
    return _mp4(pictures, fps) if kind == "mp4" else _gif(pictures, fps)


def _of_one_size(pictures: list[np.ndarray]) -> list[np.ndarray]:
    height, width = (max(picture.shape[axis] for picture in pictures) for axis in (0, 1))
    return [_padded(picture, height, width, "constant") for picture in pictures]


def _padded(picture: np.ndarray, height: int, width: int, mode: Any) -> np.ndarray:
    """With more rows below and columns to the right: black, or the last one again (mode "edge")."""
    more = ((0, height - picture.shape[0]), (0, width - picture.shape[1]), (0, 0))
    return np.pad(picture, more, mode) if np.any(more) else picture


def _gif(pictures: list[np.ndarray], fps: float) -> bytes:
    from PIL import Image

    every = math.ceil(fps / FASTEST_GIF)
    images = [Image.fromarray(picture).quantize(128) for picture in pictures[::every]]
    # Rounded as a whole, not one by one: the film takes as long as it should.
    ends = np.rint(np.arange(len(images) + 1) * TICKS * every / fps).astype(int)
    durations = (np.diff(ends) * (1000 // TICKS)).tolist()
    content = io.BytesIO()
    pace: dict[str, Any] = {"duration": durations if len(images) > 1 else durations[0], "loop": 0}
    images[0].save(content, "gif", save_all=True, append_images=images[1:], **pace)
    return content.getvalue()


def _mp4(pictures: list[np.ndarray], fps: float) -> bytes:
    try:
        imageio_ffmpeg = importlib.import_module("imageio_ffmpeg")
    except ModuleNotFoundError as error:
        words = "A film as mp4 needs imageio-ffmpeg: pip install imageio-ffmpeg, or choose gif."
        raise ModuleNotFoundError(words) from error
    # Colours are stored for squares of two pixels: a last row or column may be there twice.
    height, width = (size + size % 2 for size in pictures[0].shape[:2])
    pictures = [_padded(picture, height, width, "edge") for picture in pictures]
    raw = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:g}")
    coded = ("-an", "-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p")
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "film.mp4"
        command = (imageio_ffmpeg.get_ffmpeg_exe(), *raw, "-i", "-", *coded, str(path))
        content = b"".join(picture.tobytes() for picture in pictures)
        done = subprocess.run(command, input=content, capture_output=True)
        if done.returncode:
            raise ValueError(f"ffmpeg: {done.stderr.decode(errors='replace').splitlines()[-1]}.")
        return path.read_bytes()
