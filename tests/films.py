"""Films, read back."""

import io
import re
import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
from PIL import Image


def read_mp4(path: Path) -> tuple[list[np.ndarray], float]:
    """Pictures, and how many a second."""
    call = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path), "-f", "rawvideo"]
    done = subprocess.run([*call, "-pix_fmt", "rgb24", "-"], capture_output=True, check=True)
    found = re.search(r"Video: .* (\d+)x(\d+).*, ([\d.]+k?) fps", done.stderr.decode())
    assert found is not None
    width, height, fps = found.groups()
    pictures = np.frombuffer(done.stdout, np.uint8).reshape(-1, int(height), int(width), 3)
    return list(pictures), float(fps.replace("k", "e3"))


def read_gif(content: bytes) -> tuple[list[np.ndarray], list[float]]:
    """Pictures, and the seconds for which each is shown."""
    with Image.open(io.BytesIO(content)) as image:
        pictures, seconds = [], []
        for number in range(getattr(image, "n_frames", 1)):
            image.seek(number)
            pictures.append(np.asarray(image.convert("RGB")))
            seconds.append(image.info["duration"] / 1000)
    return pictures, seconds
