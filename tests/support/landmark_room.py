"""Landmarks of the map of `change_room`."""

from functools import cache
from pathlib import Path

import change_room
import numpy as np
from shared import viewpoints_all_around

from gslts.core.frame import RgbdFrame
from gslts.localization.landmark_extraction import extract_landmarks
from gslts.localization.landmark_files import write_landmarks
from gslts.localization.landmarks import Landmarks
from gslts.store.map_folder import write_map_folder

ARRAYS = ("positions", "descriptors", "keyframes", "world_from_keyframe", "gaussians")
"""Names of the arrays of `Landmarks`."""


@cache
def frames() -> tuple[RgbdFrame, ...]:
    """Return frames of the mapped room with perfect depth."""
    viewpoints = [
        *viewpoints_all_around("change_room", change_room.home(), 24),
        *change_room.VIEWPOINTS,
    ]
    return tuple(change_room.see(change_room.home(), viewpoint) for viewpoint in viewpoints)


@cache
def found() -> Landmarks:
    """Return the landmarks of the mapped room."""
    return extract_landmarks(change_room.mapped()[0], frames(), threads=1)


def folder_with(landmarks: Landmarks, path: Path) -> Path:
    """Write a map folder of the room as `gslts map` does."""
    gaussian_map, cameras = change_room.mapped()

    def finish(part: Path) -> dict[str, str]:
        return {"landmarks": write_landmarks(landmarks, part)}

    write_map_folder(path, gaussian_map, {}, cameras, finish)
    return path


def assert_same(first: Landmarks | None, other: Landmarks) -> None:
    """Expect the same landmarks, bit for bit."""
    assert first is not None
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(first, name), getattr(other, name), err_msg=name)
