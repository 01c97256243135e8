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
from numpy.typing import NDArray
from PIL import Image

from gslts.core.camera import Camera
from gslts.datasets.nerfstudio import OBJECTS, OPENGL_FROM_OPENCV
from gslts.io.atomic_files import empty_folder, write_atomic
from gslts.types import Floats
from gslts_sim.controller import ActionError, Controller
from gslts_sim.event import Event
from gslts_sim.robot_body import Viewpoint

SAVE_INTERVAL = 10
"""Number of frames after which the list of frames is saved again."""
FOLDERS = {"file_path": "images", "depth_file_path": "depth", "instance_file_path": "instances"}
"""Folder of each image of a frame, by its key in `transforms.json`."""
MAX_DEPTH_M = 65.535
"""Largest depth that fits into 16 bits, in millimetres, m."""
MAX_OBJECTS = (1 << 16) - 1
"""Maximum number of objects that fits into 16 bits, beside 0 for the background."""
PNG_LEVEL = 1
"""Level of zlib: images are a fifth larger than at the best level and saved ten times as fast."""


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
    for name in FOLDERS.values():
        (folder / name).mkdir()
    frames: list[dict[str, Any]] = []
    header: dict[str, Any] = {}
    try:
        _write_json(folder / OBJECTS, _objects(robot.last_event))
        for viewpoint in viewpoints:
            try:
                robot.go(viewpoint)
            except ActionError as blocked:
                raise ValueError(f"capture: {blocked}") from None
            event = robot.step("Pass")
            header = header or _header(event.observation.camera)
            frames.append(_write_frame(event, folder, len(frames)))
            if len(frames) % SAVE_INTERVAL == 0:
                _write_json(folder / "transforms.json", {**header, "frames": frames})
        _write_json(folder / "transforms.json", {**header, "frames": frames})
    except BaseException as error:
        _keep_complete_frames(folder, header, frames)
        if isinstance(error, OSError):
            reason = error.strerror or str(error)
            raise OSError(f"{folder}: {reason}; {len(frames)} complete frames are kept") from None
        raise
    return len(frames)


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


def _write_frame(event: Event, folder: Path, number: int) -> dict[str, Any]:
    """Write all images of a frame, or none, and return its entry in the list."""
    depth = event.depth_frame
    steps = np.rint(1000 * np.where(depth < MAX_DEPTH_M, depth, 0))
    images: dict[str, NDArray[Any]] = {
        "file_path": event.frame,
        "depth_file_path": steps.astype(np.uint16),
        "instance_file_path": (event.instances + 1).astype(np.uint16),
    }
    entry: dict[str, Any] = {}
    try:
        for key, image in images.items():
            entry[key] = f"{FOLDERS[key]}/{number:05}.png"
            Image.fromarray(image).save(folder / entry[key], compress_level=PNG_LEVEL)
    except BaseException:
        _remove_images(folder, entry)
        raise
    believed, true = (
        (camera.world_from_camera @ OPENGL_FROM_OPENCV).tolist()
        for camera in (event.observation.camera, event.camera)
    )
    return {**entry, "transform_matrix": believed, "true_transform_matrix": true}


def _objects(event: Event) -> list[dict[str, Any]]:
    """Return the table of objects without entries that depend on the viewpoint."""
    return [
        {key: value for key, value in obj.items() if key != "visible"}
        for obj in event.metadata["objects"]
    ]


def _keep_complete_frames(
    folder: Path, header: dict[str, Any], frames: list[dict[str, Any]]
) -> None:
    """Write the list of frames; drop the last frames until there is room for it on the disk."""
    while frames:
        try:
            _write_json(folder / "transforms.json", {**header, "frames": frames})
        except OSError:
            _remove_images(folder, frames.pop())
        else:
            return


def _remove_images(folder: Path, entry: dict[str, Any]) -> None:
    for key in FOLDERS:
        if key in entry:
            (folder / entry[key]).unlink(missing_ok=True)


def _header(camera: Camera) -> dict[str, Any]:
    return {
        "camera_model": "OPENCV",
        "w": camera.width,
        "h": camera.height,
        "fl_x": camera.fx,
        "fl_y": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        "depth_unit_scale_factor": 0.001,
    }


def _write_json(path: Path, content: Any) -> None:
    write_atomic(path, (json.dumps(content, indent=1) + "\n").encode())
