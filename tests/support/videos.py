"""Writes videos of noise."""

from pathlib import Path

import numpy as np

from gslts.io.video import Video


def write(path: Path, count: int) -> None:
    """Write a video of so many images of 64 x 48 px."""
    rng = np.random.default_rng(0)
    with Video(path, 64, 48) as video:
        for _ in range(count):
            video.add(rng.integers(0, 255, (48, 64, 3)).astype(np.uint8))
