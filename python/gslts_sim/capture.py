"""A recorded visit of a home, as a data set that other tools can train on.

Layout: nerfstudio's `transforms.json` (axes of OpenGL, world z up) with `images/`, `depth/`
(16-bit, millimetres, 0: none), and as ground truth `instances/` (16-bit, 1 + row of the object,
0: none), `objects.json` and each frame's `true_transform_matrix`, which differs from
`transform_matrix` by what the robot errs about where it is.
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
from gslts_sim.controller import ActionError, Controller
from gslts_sim.event import Event
from gslts_sim.robot_body import Viewpoint

SAVE_EVERY = 10
"""Frames after which the list of frames is written anew."""
FOLDERS = {"file_path": "images", "depth_file_path": "depth", "instance_file_path": "instances"}
FARTHEST_M = 65.535
MOST_OBJECTS = (1 << 16) - 1
PNG_LEVEL = 1
"""Of zlib: pictures are a fifth larger than at the best level and saved ten times as fast."""


def capture(robot: Controller, looks: Iterable[Viewpoint], folder: Path) -> int:
    """Takes a picture at each look and writes the data set.

    When it fails or is interrupted half-way, the frames that were whole by then stay a valid data
    set.

    Args:
        robot: In the home.
        looks: Where it goes, in this order.
        folder: New or empty.

    Returns:
        How many frames were written.

    Raises:
        OSError: The disk is full or the folder cannot be written; the frames before are kept.
        ValueError: The folder is not empty, or the robot cannot go to a look.
    """
    if len(robot.home.objects) > MOST_OBJECTS:
        raise ValueError(f"capture: more than {MOST_OBJECTS} objects do not fit into 16 bits")
    empty_folder(folder)
    for name in FOLDERS.values():
        (folder / name).mkdir()
    frames: list[dict[str, Any]] = []
    header: dict[str, Any] = {}
    try:
        _write_json(folder / OBJECTS, _objects(robot.last_event))
        for look in looks:
            try:
                robot.go(look)
            except ActionError as blocked:
                raise ValueError(f"capture: {blocked}") from None
            event = robot.step("Pass")
            header = header or _header(event.observation.camera)
            frames.append(_write_frame(event, folder, len(frames)))
            if len(frames) % SAVE_EVERY == 0:
                _write_json(folder / "transforms.json", {**header, "frames": frames})
        _write_json(folder / "transforms.json", {**header, "frames": frames})
    except BaseException as error:
        _keep_whole_frames(folder, header, frames)
        if isinstance(error, OSError):
            reason = error.strerror or str(error)
            raise OSError(f"{folder}: {reason}; {len(frames)} whole frames are kept") from None
        raise
    return len(frames)


def true_poses(folder: Path) -> dict[str, NDArray[np.float64]]:
    """[4,4] world_from_camera of each frame that was captured, as it really was, by its name.

    Raises:
        OSError: The list of frames cannot be read.
        ValueError: It is none that `capture` wrote.
    """
    path = folder / "transforms.json"
    try:
        frames = json.loads(path.read_bytes())["frames"]
        return {
            Path(one["file_path"]).stem: np.array(one["true_transform_matrix"], np.float64)
            @ OPENGL_FROM_OPENCV
            for one in frames
        }
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: it does not tell true poses: {error}") from None


def _write_frame(event: Event, folder: Path, number: int) -> dict[str, Any]:
    """Writes the pictures of a frame, all or none, and returns its entry in the list."""
    depth = event.depth_frame
    steps = np.rint(1000 * np.where(depth < FARTHEST_M, depth, 0))  # What is too far is no depth.
    pictures: dict[str, NDArray[Any]] = {
        "file_path": event.frame,
        "depth_file_path": steps.astype(np.uint16),
        "instance_file_path": (event.instances + 1).astype(np.uint16),
    }
    entry: dict[str, Any] = {}
    try:
        for key, picture in pictures.items():
            entry[key] = f"{FOLDERS[key]}/{number:05}.png"
            Image.fromarray(picture).save(folder / entry[key], compress_level=PNG_LEVEL)
    except BaseException:
        _remove_pictures(folder, entry)
        raise
    believed, true = (
        (camera.world_from_camera @ OPENGL_FROM_OPENCV).tolist()
        for camera in (event.observation.camera, event.camera)
    )
    return {**entry, "transform_matrix": believed, "true_transform_matrix": true}


def _objects(event: Event) -> list[dict[str, Any]]:
    """The table of objects, without what holds for one look only."""
    return [
        {key: value for key, value in thing.items() if key != "visible"}
        for thing in event.metadata["objects"]
    ]


def _keep_whole_frames(folder: Path, header: dict[str, Any], frames: list[dict[str, Any]]) -> None:
    """Writes the list of frames, giving up frames until there is room for it."""
    while frames:
        try:
            _write_json(folder / "transforms.json", {**header, "frames": frames})
        except OSError:
            _remove_pictures(folder, frames.pop())
        else:
            return


def _remove_pictures(folder: Path, entry: dict[str, Any]) -> None:
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
