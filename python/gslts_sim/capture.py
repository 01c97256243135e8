"""Recordings of a home in nerfstudio's layout, with ground truth.

`transforms.json` (OpenGL axes, world z up) with `images/`, `depth/` (16-bit, millimetres, 0: no
measurement). Ground truth: `instances/` (16-bit, 1 + row of the object, 0: background),
`objects.json` and each frame's `true_transform_matrix`; `transform_matrix` is the pose that the
robot believes.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from gslts.datasets.nerfstudio import OBJECTS
from gslts.datasets.poses import OPENGL_FROM_OPENCV
from gslts.datasets.recording import MAX_OBJECTS, RecordingWriter, write_json
from gslts.io.atomic_files import empty_folder
from gslts.types import Floats
from gslts_sim.controller import ActionError, Controller
from gslts_sim.event import Event
from gslts_sim.robot_body import Viewpoint


def capture(robot: Controller, viewpoints: Iterable[Viewpoint], folder: Path) -> int:
    """Record a frame at each viewpoint as a data set.

    After a failure or an interruption, the complete frames remain as a valid data set.

    Args:
        robot: In the home.
        viewpoints: Visited in this order.
        folder: New or empty.

    Returns:
        Number of frames.

    Raises:
        OSError: The disk is full or the folder cannot be written; complete frames are kept.
        ValueError: The folder is not empty, or the robot cannot reach a viewpoint.
    """
    if len(robot.home.objects) > MAX_OBJECTS:
        raise ValueError(f"capture: more than {MAX_OBJECTS} objects do not fit into 16 bits")
    empty_folder(folder)
    writer = RecordingWriter(folder)
    try:
        write_json(folder / OBJECTS, _objects(robot.last_event))
        for viewpoint in viewpoints:
            try:
                robot.go(viewpoint)
            except ActionError as blocked:
                raise ValueError(f"capture: {blocked}") from None
            event = robot.step("Pass")
            true_pose = event.camera.world_from_camera @ OPENGL_FROM_OPENCV
            writer.add(event.observation, {"true_transform_matrix": true_pose.tolist()})
        writer.save()
    except BaseException as error:
        writer.keep_complete_frames()
        if isinstance(error, OSError):
            reason = error.strerror or str(error)
            raise OSError(f"{folder}: {reason}; {writer.count} complete frames are kept") from None
        raise
    return writer.count


def true_poses(folder: Path) -> dict[str, Floats]:
    """Read the true poses of the frames of a recording.

    Args:
        folder: Of a data set that `capture` wrote.

    Returns:
        [4,4] world_from_camera, m, by the name of the frame.

    Raises:
        OSError: The list of frames cannot be read.
        ValueError: It has no true poses.
    """
    path = folder / "transforms.json"
    try:
        frames = json.loads(path.read_bytes())["frames"]
        return {
            Path(frame["file_path"]).stem: np.array(frame["true_transform_matrix"], np.float64)
            @ OPENGL_FROM_OPENCV
            for frame in frames
        }
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: it has no true poses: {error}") from None


def _objects(event: Event) -> list[dict[str, Any]]:
    """Return the table of objects without entries that depend on the viewpoint."""
    return [
        {key: value for key, value in obj.items() if key != "visible"}
        for obj in event.metadata["objects"]
    ]
