"""Recordings in nerfstudio's layout: colour and depth of each frame, and object labels if known."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.datasets.nerfstudio import OBJECTS
from gslts.datasets.poses import OPENGL_FROM_OPENCV
from gslts.io.atomic_files import write_atomic

SAVE_INTERVAL = 10
"""Number of frames after which the list of frames is saved again."""
FOLDERS = {"file_path": "images", "depth_file_path": "depth", "instance_file_path": "instances"}
"""Folder of each image of a frame, by its key in `transforms.json`."""
MAX_DEPTH_M = 65.535
"""Largest depth that fits into 16 bits, in millimetres, m."""
PNG_LEVEL = 1
"""Level of zlib: images are a fifth larger than at the best level and saved ten times as fast."""


class RecordingWriter:
    """Writes frames as a data set.

    It has `transforms.json`, and the folders `images`, `depth` (16-bit, mm; 0: no measurement) and
    `instances` (16-bit, 1 + row of the object, 0: background).
    After a failure or an interruption, the frames of the last list remain as a valid data set; the
    next writer of the folder continues it.

    Args:
        folder: New, empty, or a recording of this class.

    Raises:
        OSError: The folder cannot be written.
        ValueError: The folder holds something else, or its list is damaged.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._frames: list[dict[str, Any]] = []
        list_path = folder / "transforms.json"
        if list_path.exists():
            try:
                self._frames = list(json.loads(list_path.read_bytes())["frames"])
            except (KeyError, TypeError, ValueError) as error:
                raise ValueError(f"{list_path}: it is no list of frames: {error}") from None
        elif folder.exists() and any(folder.iterdir()):
            raise ValueError(f"{folder}: it is not empty, and no recording")
        for name in FOLDERS.values():
            (folder / name).mkdir(parents=True, exist_ok=True)
        self._header: dict[str, Any] = {}

    @property
    def count(self) -> int:
        """Number of frames."""
        return len(self._frames)

    def add(self, frame: RgbdFrame, more: Mapping[str, Any] | None = None) -> None:
        """Write all images of a frame, or none.

        Args:
            frame: Its depth is registered first.
            more: Further entries of the frame in the list.

        Raises:
            OSError: The disk is full or the folder cannot be written.
        """
        frame = frame.registered()
        if not self._header:
            self._header = _header(frame.camera)
        depth = np.where(frame.depth < MAX_DEPTH_M, np.nan_to_num(frame.depth), 0)
        images: dict[str, NDArray[Any]] = {
            "file_path": frame.rgb,
            "depth_file_path": np.rint(1000 * depth).astype(np.uint16),
        }
        if frame.labels is not None:
            images["instance_file_path"] = (frame.labels.instances + 1).astype(np.uint16)
        entry: dict[str, Any] = {}
        try:
            if frame.labels is not None and not (self._folder / OBJECTS).exists():
                types = [{"objectType": name} for name in frame.labels.types]
                write_json(self._folder / OBJECTS, types)
            for key, image in images.items():
                entry[key] = f"{FOLDERS[key]}/{len(self._frames):05}.png"
                Image.fromarray(image).save(self._folder / entry[key], compress_level=PNG_LEVEL)
        except BaseException:
            self._remove(entry)
            raise
        pose = (frame.camera.world_from_camera @ OPENGL_FROM_OPENCV).tolist()
        self._frames.append({**entry, "transform_matrix": pose, **(more or {})})
        if len(self._frames) % SAVE_INTERVAL == 0:
            self.save()

    def save(self) -> None:
        """Write the list of frames.

        Raises:
            OSError: The disk is full or the folder cannot be written.
        """
        content = {**self._header, "frames": self._frames}
        write_json(self._folder / "transforms.json", content)

    def keep_complete_frames(self) -> None:
        """Write the list; drop the last frames until there is room for it on the disk."""
        while self._frames:
            try:
                self.save()
            except OSError:
                self._remove(self._frames.pop())
            else:
                return

    def _remove(self, entry: Mapping[str, Any]) -> None:
        for key in FOLDERS:
            if key in entry:
                (self._folder / entry[key]).unlink(missing_ok=True)


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file atomically.

    Args:
        path: Of the file.
        content: Values of JSON.

    Raises:
        OSError: The file cannot be written.
    """
    write_atomic(path, (json.dumps(content, indent=1) + "\n").encode())


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
