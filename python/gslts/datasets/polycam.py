"""Raw data of Polycam, an app for phones with LiDAR (its export "raw data" in developer mode).

Source: https://github.com/PolyCam/polyform, "Polycam's data format".
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from gslts.datasets.arkit import pose_from_arkit
from gslts.datasets.dataset import MAX_SIDE_PX, Dataset, gather, name_of, pinhole, resize_camera
from gslts.datasets.files import image_file, read_json
from gslts.datasets.image_frame import ImageFrame
from gslts.io.image_files import image_size

KEYFRAMES = "keyframes"
"""Folder of all images and cameras."""
BORDER_PX = 15
"""Border of corrected images that may be black, as nerfstudio crops them."""


class _Camera(BaseModel):
    """Intrinsics, px, and three rows of the pose in ARKit's axes, m."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    width: int = Field(ge=1, le=MAX_SIDE_PX)
    height: int = Field(ge=1, le=MAX_SIDE_PX)
    fx: FiniteFloat
    fy: FiniteFloat
    cx: FiniteFloat
    cy: FiniteFloat
    t_00: FiniteFloat
    t_01: FiniteFloat
    t_02: FiniteFloat
    t_03: FiniteFloat
    t_10: FiniteFloat
    t_11: FiniteFloat
    t_12: FiniteFloat
    t_13: FiniteFloat
    t_20: FiniteFloat
    t_21: FiniteFloat
    t_22: FiniteFloat
    t_23: FiniteFloat


def is_polycam(path: Path) -> bool:
    """Return True if a folder is raw data of Polycam.

    Args:
        path: Any path.
    """
    return (path / KEYFRAMES / "cameras").is_dir()


def open_polycam(path: Path) -> Dataset:
    """Open a capture.

    Optimized poses and undistorted images are used if Polycam wrote them. Depth of low confidence
    is dropped. The principal point is taken as measured from the corner of the image.

    Args:
        path: Folder of the capture, with `keyframes` in it.
    """
    corrected = all(
        (path / KEYFRAMES / f"corrected_{part}").is_dir() for part in ("cameras", "images")
    )
    prefix = "corrected_" if corrected else ""
    stems = sorted(file.stem for file in (path / KEYFRAMES / f"{prefix}cameras").glob("*.json"))
    frames, skipped, missing = gather(
        ((stem, stem) for stem in stems), lambda stem: _frame(path, stem, prefix)
    )
    return Dataset(name_of(path), frames, skipped, missing=missing)


def _frame(path: Path, stem: str, prefix: str) -> ImageFrame:
    """Return the frame of a keyframe, whose name is its time in microseconds."""
    rgb = image_file(path, f"{KEYFRAMES}/{prefix}images/{stem}.jpg")
    depth = image_file(path, f"{KEYFRAMES}/depth/{stem}.png", "depth image")
    confidence = path / KEYFRAMES / "confidence" / f"{stem}.png"
    values = read_json(path / KEYFRAMES / f"{prefix}cameras" / f"{stem}.json", _Camera)
    rows = [[getattr(values, f"t_{row}{column}") for column in range(4)] for row in range(3)]
    camera = pinhole(
        (values.fx, values.fy, values.cx, values.cy),
        (values.width, values.height),
        pose_from_arkit(np.array([*rows, [0, 0, 0, 1]], np.float64)),
    )
    return ImageFrame(
        rgb,
        camera,
        depth,
        time_s=int(stem) * 1e-6 if stem.isdecimal() else 0.0,
        depth_camera=resize_camera(camera, image_size(depth)),
        confidence=confidence if confidence.exists() else None,
        border_px=BORDER_PX if prefix else 0,
    )
