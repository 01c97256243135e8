"""Recordings of a robot's frames, as Polycam and Record3D document theirs."""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from recorded_frames import frames_of_robot
from scipy.spatial.transform import Rotation

from gslts.core.frame import RgbdFrame

ARKIT_FROM_WORLD = np.eye(4)
"""ARKit's y is up, and so -z is what was y."""
ARKIT_FROM_WORLD[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
BACKWARD = np.diag([1.0, -1.0, -1.0, 1.0])
"""ARKit's camera has x right, y up and z towards the photographer."""
UNSURE = np.s_[3:9, 5:20]
"""Pixels of a depth image with low confidence."""


def arkit_pose(frame: RgbdFrame) -> np.ndarray:
    return ARKIT_FROM_WORLD @ frame.camera.world_from_camera @ BACKWARD


def small_depths() -> list[np.ndarray]:
    """Depth of LiDAR has half the width and height of the images here."""
    return [frame.depth for frame in frames_of_robot(32, 24)]


def confidence(low: int, high: int) -> np.ndarray:
    levels = np.full((24, 32), high, np.uint8)
    levels[UNSURE] = low
    return levels


def write_polycam(folder: Path, corrected: bool = True) -> Path:
    """By Polycam's own words: rows t_ij in ARKit's axes, names in microseconds, mm."""
    parts = ["images", "cameras", "depth", "confidence"]
    parts += ["corrected_images", "corrected_cameras"] if corrected else []
    for part in parts:
        (folder / "keyframes" / part).mkdir(parents=True)
    for number, (frame, depth) in enumerate(zip(frames_of_robot(), small_depths(), strict=True)):
        stem = str(1_700_000_000_000_000 + 500_000 * number)
        camera, pose = frame.camera, arkit_pose(frame)
        values = {name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy")}
        values |= {"width": camera.width, "height": camera.height, "blur_score": 120.5}
        values |= {f"t_{k // 4}{k % 4}": pose.ravel()[k] for k in range(12)}
        for prefix in ("corrected_", "") if corrected else ("",):
            path = folder / "keyframes" / f"{prefix}cameras" / f"{stem}.json"
            if corrected and not prefix:  # ARKit's own poses drift.
                values["t_03"] += 0.5
            path.write_text(json.dumps(values))
            Image.fromarray(frame.rgb).save(
                folder / "keyframes" / f"{prefix}images" / f"{stem}.jpg", quality=95
            )
        steps = np.rint(1000 * depth).astype(np.uint16)
        Image.fromarray(steps).save(folder / "keyframes" / "depth" / f"{stem}.png")
        Image.fromarray(confidence(0, 127)).save(folder / f"keyframes/confidence/{stem}.png")
    (folder / "mesh_info.json").write_text("{}")
    return folder


def metadata(**changed: Any) -> dict:
    """By its developer's words: quaternions x y z w and positions, K by columns."""
    frames = frames_of_robot()
    camera = frames[0].camera
    poses = [
        [*Rotation.from_matrix(pose[:3, :3]).as_quat(), *pose[:3, 3]]
        for pose in map(arkit_pose, frames)
    ]
    values = {
        "w": camera.width,
        "h": camera.height,
        "dw": 32,
        "dh": 24,
        "fps": 60,
        "K": [camera.fx, 0, 0, 0, camera.fy, 0, camera.cx, camera.cy, 1],
        "poses": poses,
        "initPose": [0, 0, 0, 1, 0, 0, 0],
        "cameraType": 1,
    }
    return values | changed


def write_r3d(folder: Path, **changed: Any) -> Path:
    lzfse = pytest.importorskip("lzfse")
    (folder / "rgbd").mkdir(parents=True)
    (folder / "metadata").write_text(json.dumps(metadata(**changed)))
    for number, (frame, depth) in enumerate(zip(frames_of_robot(), small_depths(), strict=True)):
        start = folder / "rgbd" / str(number)
        Image.fromarray(frame.rgb).save(f"{start}.jpg", quality=95)
        metres = np.where(depth > 0, depth, np.nan).astype("<f4")
        Path(f"{start}.depth").write_bytes(lzfse.compress(metres.tobytes()))
        Path(f"{start}.conf").write_bytes(lzfse.compress(confidence(0, 2).tobytes()))
    return folder


def pack(folder: Path) -> Path:
    path = folder.with_suffix(".r3d")
    with zipfile.ZipFile(path, "w") as archive:
        for file in sorted(folder.rglob("*")):
            archive.write(file, file.relative_to(folder))
    return path
