"""Exports of a robot's frames as `rtabmap-export` writes them."""

from pathlib import Path

import numpy as np
from PIL import Image
from recorded_frames import frames_of_robot
from ros_bags import MOUNT, OPTICAL
from scipy.spatial.transform import Rotation

STAMP = "1700000000.{}00000"
ROBOT_FROM_CAMERA = MOUNT @ OPTICAL


def write_rtabmap(
    folder: Path,
    prefix: str = "home_",
    poses: str = "camera_poses",
    by_id: bool = False,
    width: int = 32,
) -> Path:
    """By `tools/Export/main.cpp`: frames of ROS, depth in mm, matrices as OpenCV writes them."""
    rows = ["#timestamp x y z qx qy qz qw id"]
    for name in ("rgb", "depth", "calib", "confidence"):
        (folder / f"{prefix}{name}").mkdir(parents=True)
    small = frames_of_robot(width, width * 3 // 4)
    for number, (frame, depth) in enumerate(zip(frames_of_robot(), small, strict=True)):
        stamp, node = STAMP.format(number), 7 * number + 1
        stem = str(node) if by_id else stamp
        Image.fromarray(frame.rgb).save(folder / f"{prefix}rgb/{stem}.jpg", quality=95)
        steps = np.rint(1000 * depth.depth).astype(np.uint16)
        Image.fromarray(steps).save(folder / f"{prefix}depth/{stem}.png")
        confidence = np.full(steps.shape, 100, np.uint8)
        confidence[:2] = 0
        Image.fromarray(confidence).save(folder / f"{prefix}confidence/{stem}.png")
        write_calibration(folder / f"{prefix}calib/{stem}.yaml", frame.camera, stem)
        pose = frame.camera.world_from_camera
        if "camera" not in poses:
            pose = pose @ np.linalg.inv(ROBOT_FROM_CAMERA)
        numbers = [*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()]
        rows.append(f"{stamp} {' '.join(f'{v:f}' for v in numbers)} {node}")
    (folder / f"{prefix}{poses}.txt").write_text("\n".join(rows) + "\n")
    return folder


def write_calibration(path: Path, camera: object, name: str) -> None:
    """As OpenCV's FileStorage, with the middle of the first pixel at (0, 0)."""
    k = [camera.fx, 0, camera.cx - 0.5, 0, camera.fy, camera.cy - 0.5, 0, 0, 1]
    p = [*k[:3], 0, *k[3:6], 0, *k[6:], 0]
    matrices = {
        "camera_matrix": (3, 3, k),
        "distortion_coefficients": (1, 5, [0.1, -0.2, 0, 0, 0]),
        "projection_matrix": (3, 4, p),
        "local_transform": (3, 4, ROBOT_FROM_CAMERA[:3].ravel().tolist()),
    }
    text = f'%YAML:1.0\n---\ncamera_name: "{name}"\n'
    text += f"image_width: {camera.width}\nimage_height: {camera.height}\n"
    for key, (rows, columns, data) in matrices.items():
        text += f"{key}:\n   rows: {rows}\n   cols: {columns}\n   data: {data}\n"
    path.write_text(text)
