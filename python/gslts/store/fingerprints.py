"""Fingerprints of images, by which a map recognizes the recording that it was made of.

Neither names nor poses identify a recording: each may have a frame `00000` in a folder `scan`, and
poses may be estimated.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from gslts.datasets import Dataset, Frame
from gslts.store.manifest import read_manifest, split_version
from gslts.types import Bytes, Ints

FINGERPRINTS = "fingerprints"
"""Key of the manifest: fingerprints of the frames of the map, by name."""
SIZE_PX = (8, 6)
"""Width and height of the tiny image that is the fingerprint, px."""
COMPARED_FRAMES = 8
"""Maximum number of frames, evenly chosen, that are read and compared: 10 to 50 ms each."""
MAX_DIFFERENCE = 2
"""Maximum difference of equal fingerprints in any pixel, grey levels of 255. Compression
changes them by 1; in 7-Scenes, frames 0.5 cm and a few degrees apart differ by 3 and more."""


def fingerprint(rgb: Bytes) -> str:
    """Return the fingerprint of an image: a tiny grey image, in hexadecimal digits.

    Args:
        rgb: [H,W,3] sRGB.
    """
    import cv2

    small = np.asarray(cv2.resize(rgb, SIZE_PX, interpolation=cv2.INTER_AREA), np.uint8)
    return bytes(np.rint(small.mean(axis=2)).astype(np.uint8)).hex()


def is_recording_of(map_path: Path, dataset: Dataset) -> bool:
    """Return True if a map was made of a recording, or of a part of it, wherever it lies now.

    Most of the compared frames must have the fingerprints of the frames of their names. In maps
    without fingerprints, the name of the data set decides.

    Args:
        map_path: Folder of the map, `FOLDER@NUMBER`, or a PLY file.
        dataset: The recording, at any poses.

    Raises:
        OSError: The manifest cannot be read.
        ValueError: It is damaged.
    """
    folder, _ = split_version(map_path)
    if not folder.is_dir():
        return False
    manifest = read_manifest(folder)
    if FINGERPRINTS not in manifest:
        return bool(manifest.get("dataset", dataset.name) == dataset.name)
    try:
        known = {name: _pixels(text) for name, text in manifest[FINGERPRINTS].items()}
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"{folder}: {FINGERPRINTS} of the manifest: {error}") from None
    same = list(_compare(known, [frame for frame in dataset.frames if frame.name in known]))
    return 2 * sum(same) > len(same)


def _compare(known: Mapping[str, Ints], frames: list[Frame]) -> Iterator[bool]:
    """Yield for some frames whether they have the known fingerprints; damaged frames have none."""
    count = min(len(frames), COMPARED_FRAMES)
    for k in np.linspace(0, len(frames) - 1, count).round().astype(int):
        try:
            pixels = _pixels(fingerprint(frames[k].read().rgb))
        except (OSError, ValueError):
            continue
        yield bool(np.abs(pixels - known[frames[k].name]).max() <= MAX_DIFFERENCE)


def _pixels(text: str) -> Ints:
    """Return the pixels [48] of a fingerprint."""
    pixels = np.frombuffer(bytes.fromhex(text), np.uint8).astype(np.int64)
    if len(pixels) != SIZE_PX[0] * SIZE_PX[1]:
        raise ValueError(f"expected {SIZE_PX[0] * SIZE_PX[1]} bytes, got {len(pixels)}")
    return pixels
