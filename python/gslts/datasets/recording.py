"""Recordings in nerfstudio's layout: colour and depth of each frame, and object labels if known."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.core.frame import Labels, RgbdFrame
from gslts.datasets.files import read_json
from gslts.datasets.nerfstudio import OBJECTS
from gslts.datasets.poses import OPENGL_FROM_OPENCV
from gslts.io.atomic_files import write_atomic
from gslts.io.image_files import encode_png

SAVE_INTERVAL = 10
"""Number of frames after which the list of frames is saved again; it is also after the first."""
FOLDERS = {
    "file_path": "images",
    "depth_file_path": "depth",
    "instance_file_path": "instances",
    "mask_path": "masks",
}
"""Folder of each image of a frame, by its key in `transforms.json`."""
MAX_DEPTH_M = 65.535
"""Largest depth that fits into 16 bits, in millimetres, m."""
MAX_OBJECTS = (1 << 16) - 1
"""Maximum number of objects that fits into 16 bits, beside 0 for the background."""
FORMAT = {"camera_model": "OPENCV", "depth_unit_scale_factor": 0.001}
"""Camera model and unit of depth, m, of all recordings."""
NO_LENS = dict.fromkeys(("k1", "k2", "k3", "k4", "p1", "p2", "is_fisheye"), 0)
"""Distortion of a list that can be continued: recorded images have none."""
TYPE = "objectType"
"""Key of the type of an object in the list of objects."""


class RecordingWriter:
    """Writes frames as a data set.

    It has `transforms.json`, and the folders `images`, `depth` (16-bit, mm; 0: no measurement),
    `instances` (16-bit, 1 + row of the object in `objects.json`, 0: background) and `masks` (8-bit,
    0: not used; only of frames that need it). A frame of another camera than the first one has its
    intrinsics in its entry of the list.
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
        self._header: dict[str, Any] = {}
        self._frames: list[dict[str, Any]] = []
        self._objects: list[dict[str, Any]] | None = None
        list_path = folder / "transforms.json"
        if list_path.exists():
            self._header, self._frames = _read_list(list_path)
        elif any(path.is_file() for path in folder.rglob("*")):
            raise ValueError(f"{folder}: it is not empty, and no recording")
        for name in FOLDERS.values():
            (folder / name).mkdir(parents=True, exist_ok=True)
        self._saved = len(self._frames)

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
            ValueError: There are too many objects, or their list is damaged.
        """
        frame = frame.registered()
        intrinsics = _intrinsics(frame.camera)
        if not self._frames:
            self._header |= {**FORMAT, **intrinsics}
        depth = np.where(frame.depth < MAX_DEPTH_M, np.nan_to_num(frame.depth), 0)
        images: dict[str, NDArray[Any]] = {
            "file_path": frame.rgb,
            "depth_file_path": np.rint(1000 * depth).astype(np.uint16),
        }
        if frame.labels is not None:
            images["instance_file_path"] = self._instances(frame.labels)
        if frame.mask is not None and not frame.mask.all():
            images["mask_path"] = 255 * frame.mask.astype(np.uint8)
        entry: dict[str, Any] = {}
        try:
            for key, image in images.items():
                entry[key] = f"{FOLDERS[key]}/{len(self._frames):05}.png"
                (self._folder / entry[key]).write_bytes(encode_png(image))
        except BaseException:
            self._remove(entry)
            raise
        entry["transform_matrix"] = (frame.camera.world_from_camera @ OPENGL_FROM_OPENCV).tolist()
        own = {key: each for key, each in intrinsics.items() if self._header.get(key) != each}
        self._frames.append({**entry, **own, **(more or {})})
        if len(self._frames) % SAVE_INTERVAL == 0 or len(self._frames) == 1:
            self.save()

    def save(self) -> None:
        """Write the list of frames.

        Raises:
            OSError: The disk is full or the folder cannot be written.
        """
        content = {**self._header, "frames": self._frames}
        write_json(self._folder / "transforms.json", content)
        self._saved = len(self._frames)

    def keep_complete_frames(self) -> None:
        """Write the list if it grew; drop new frames until there is room for it on the disk."""
        while len(self._frames) > self._saved:
            try:
                self.save()
            except OSError:
                self._remove(self._frames.pop())
            else:
                return

    def _instances(self, labels: Labels) -> NDArray[np.uint16]:
        """Return the label image of a frame; list its objects, if the list lacks them.

        The second Mug of a frame is the second Mug of the list.
        """
        path = self._folder / OBJECTS
        if self._objects is None:
            self._objects = _read_objects(path) if path.exists() else []
        names = _numbered(each[TYPE] for each in self._objects)
        rows = {name: row for row, name in enumerate(names)}
        row_of = [rows.setdefault(name, len(rows)) for name in _numbered(labels.types)]
        if len(rows) > MAX_OBJECTS:
            raise ValueError(f"{path}: {len(rows)} objects, at most {MAX_OBJECTS} fit into 16 bits")
        if len(rows) > len(self._objects):
            new = [{TYPE: name} for name, _ in list(rows)[len(self._objects) :]]
            write_json(path, [*self._objects, *new])
            self._objects += new
        return np.array([0, *(row + 1 for row in row_of)], np.uint16)[labels.instances + 1]

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


def _read_list(path: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return the keys of a list for all of its frames, and the frames."""
    try:
        content = json.loads(path.read_bytes())
        frames = list(content["frames"])
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise ValueError(f"{path}: it is no list of frames: {error}") from None
    header = {key: value for key, value in content.items() if key != "frames"}
    for key, expected in {**FORMAT, **NO_LENS}.items():
        if header.get(key, expected) != expected:
            raise ValueError(f"{path}: it is no recording of gslts: {key} is {header[key]}")
    return header, frames


def _read_objects(path: Path) -> list[dict[str, Any]]:
    """Return the list of objects; a simulator adds more facts than their types."""
    objects = read_json(path, list[dict[str, Any]])
    for number, each in enumerate(objects):
        if not isinstance(each.get(TYPE), str):
            raise ValueError(f"{path}: object {number} has no {TYPE}")
    return objects


def _numbered(names: Iterable[str]) -> Iterator[tuple[str, int]]:
    """Yield each name with the number of the same names before it."""
    counts: Counter[str] = Counter()
    for name in names:
        yield name, counts[name]
        counts[name] += 1


def _intrinsics(camera: Camera) -> dict[str, Any]:
    return {
        "w": camera.width,
        "h": camera.height,
        "fl_x": camera.fx,
        "fl_y": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
    }
