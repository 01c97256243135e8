"""Renderings of Replica (Straub et al. 2019) by iMAP, as NICE-SLAM distributes them.

Source: https://github.com/cvg/nice-slam, `src/utils/datasets.py`; the poses are camera to world in
the axes of OpenCV, and pixel centres are whole numbers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from gslts.datasets.dataset import MAX_SIDE_PX, Dataset, gather, name_of, pinhole, rigid
from gslts.datasets.files import image_file, read_json, read_rows
from gslts.datasets.image_frame import ImageFrame

CAMERA = "cam_params.json"
"""File with the camera of all scenes, in the folder above them."""


class _Camera(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)

    w: int = Field(ge=1, le=MAX_SIDE_PX)
    h: int = Field(ge=1, le=MAX_SIDE_PX)
    fx: FiniteFloat
    fy: FiniteFloat
    cx: FiniteFloat
    cy: FiniteFloat
    scale: Annotated[FiniteFloat, Field(gt=0)]


class _File(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)

    camera: _Camera


def is_replica(path: Path) -> bool:
    """Return True if a folder is a scene.

    Args:
        path: Any path.
    """
    return (path / "traj.txt").is_file() and (path / "results").is_dir()


def open_replica(path: Path) -> Dataset:
    """Open a scene.

    Args:
        path: Folder of the scene, such as `Replica/room0`.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no camera, or the list of poses is damaged.
    """
    files = (path / CAMERA, path.resolve().parent / CAMERA)
    file = next((file for file in files if file.is_file()), None)
    if file is None:
        raise ValueError(f"{path}: there is no {CAMERA} in it or beside it; copy that of Replica")
    camera = read_json(file, _File).camera
    intrinsics = (camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5)
    rows, bad_lines = read_rows(path / "traj.txt", 16, 16)
    if bad_lines:  # The number of a line is that of its frame.
        raise ValueError(f"{path / 'traj.txt'}: {bad_lines[0]}")

    def make(entry: tuple[int, list[str]]) -> ImageFrame:
        number, row = entry
        return ImageFrame(
            image_file(path, f"results/frame{number:06}.jpg"),
            pinhole(
                intrinsics,
                (camera.w, camera.h),
                rigid(np.array(row, np.float64).reshape(4, 4)),
            ),
            image_file(path, f"results/depth{number:06}.png", "depth image"),
            1 / camera.scale,
            time_s=float(number),
        )

    entries = ((f"frame{entry[0]:06}", entry) for entry in enumerate(rows))
    frames, skipped, missing = gather(entries, make)
    return Dataset(name_of(path), frames, skipped, missing=missing)
