"""Visits of a home: parts of a recording, each beside another one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gslts.core.camera import Camera
from gslts.datasets import Dataset, Frame
from gslts_sim.home import Home

TEST_EVERY = 8
"""Every 8th frame of the recording is in no visit: it tests all maps."""
OVERLAP_M = 1.0
"""Overlap of visits to a home of one large room, m."""
AHEAD_M = 2.0
"""Distance of the point ahead of a camera that tells which part of a large room it shows, m."""


def split_visits(recording: Dataset, home: Home, parts: int) -> tuple[list[Dataset], Dataset]:
    """Split a recording into visits and test frames.

    Of several rooms, the first is seen in each visit, with one of the others. A single room is cut
    across its longer side into parts that overlap.

    Args:
        recording: Of the whole home.
        home: Its rooms, in the world of the recording.
        parts: Number of parts of a single room.

    Returns:
        The visits, and the test frames.
    """
    test = recording.frames[::TEST_EVERY]
    others = [frame for k, frame in enumerate(recording.frames) if k % TEST_EVERY]
    groups = _by_room(others, home) if len(home.rooms) > 1 else _by_place(others, home, parts)
    return [replace(recording, frames=tuple(group)) for group in groups], replace(
        recording, frames=test
    )


def _by_room(frames: list[Frame], home: Home) -> list[list[Frame]]:
    centres = np.array([frame.camera.world_from_camera[:2, 3] for frame in frames])
    boxes = [room.box[:, :2] for room in home.rooms]
    inside = np.array([((centres >= low) & (centres <= high)).all(axis=1) for low, high in boxes])
    return [
        [frame for frame, own in zip(frames, inside[0] | room, strict=True) if own]
        for room in inside[1:]
    ]


def _by_place(frames: list[Frame], home: Home, parts: int) -> list[list[Frame]]:
    axis = int(np.ptp(home.rooms[0].box[:, :2], axis=0).argmax())
    places = np.array([_ahead(frame.camera)[axis] for frame in frames])
    edges = np.quantile(places, np.linspace(0, 1, parts + 1))
    edges[-1] = np.inf
    return [
        [
            frame
            for frame, place in zip(frames, places, strict=True)
            if edges[k] - (OVERLAP_M if k else 0) <= place < edges[k + 1]
        ]
        for k in range(parts)
    ]


def _ahead(camera: Camera) -> np.ndarray:
    pose = camera.world_from_camera
    return np.asarray(pose[:3, 3] + AHEAD_M * pose[:3, 2])
