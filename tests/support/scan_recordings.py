"""Recordings of a robot's frames in the formats of ScanNet and Replica, after their tools."""

import io
import json
import struct
import zlib
from pathlib import Path

import numpy as np
from PIL import Image
from recorded_frames import frames_of_robot

from gslts.core.frame import RgbdFrame


def intrinsics(frame: RgbdFrame) -> np.ndarray:
    """The middle of the first pixel is (0, 0)."""
    matrix, camera = np.eye(4), frame.camera
    matrix[0, 0], matrix[1, 1] = camera.fx, camera.fy
    matrix[:2, 2] = camera.cx - 0.5, camera.cy - 0.5
    return matrix


def write_scannet(folder: Path) -> Path:
    """By the words of SensReader: text matrices, camera to world, depth in millimetres."""
    small = frames_of_robot(32, 24)
    for name in ("color", "depth", "pose", "intrinsic"):
        (folder / name).mkdir(parents=True)
    for number, (frame, depth) in enumerate(zip(frames_of_robot(), small, strict=True)):
        at = 5 * number
        Image.fromarray(frame.rgb).save(folder / f"color/{at}.jpg", quality=95)
        steps = np.rint(1000 * depth.depth).astype(np.uint16)
        Image.fromarray(steps).save(folder / f"depth/{at}.png")
        np.savetxt(folder / f"pose/{at}.txt", frame.camera.world_from_camera, fmt="%f")
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", intrinsics(frame), fmt="%f")
    np.savetxt(folder / "intrinsic/intrinsic_depth.txt", intrinsics(depth), fmt="%f")
    return folder


def write_sens(path: Path, color: int = 2, packed: int = 1, **changed: int) -> Path:
    """By the words of `SensReader/README.md` and the order of its Python reader."""
    frames = frames_of_robot()
    camera = frames[0].camera
    name = b"StructureSensor"
    content = [struct.pack("<IQ", changed.get("version", 4), len(name)), name]
    for matrix in (intrinsics(frames[0]), np.eye(4)) * 2:
        content.append(matrix.astype("<f4").tobytes())
    sizes = (camera.width, camera.height) * 2
    content.append(struct.pack("<2i4IfQ", color, packed, *sizes, 1000.0, len(frames)))
    for number, frame in enumerate(frames):
        file = io.BytesIO()
        Image.fromarray(frame.rgb).save(file, "JPEG", quality=95)
        depth = np.rint(1000 * frame.depth).astype("<u2").tobytes()
        depth = zlib.compress(bytes(changed.get("bomb", 0)) or depth) if packed == 1 else depth
        content.append(frame.camera.world_from_camera.astype("<f4").tobytes())
        stamp = 1_000_000 + 33_333 * number
        content.append(struct.pack("<4Q", stamp, stamp, file.tell(), len(depth)))
        content += [file.getvalue(), depth]
    path.write_bytes(b"".join(content))
    return path


def write_replica(folder: Path) -> Path:
    """By the words of NICE-SLAM: a row of `traj.txt` is a pose, camera to world."""
    (folder / "results").mkdir(parents=True)
    rows = []
    for number, frame in enumerate(frames_of_robot()):
        Image.fromarray(frame.rgb).save(folder / f"results/frame{number:06}.jpg", quality=95)
        steps = np.rint(6553.5 * frame.depth).astype(np.uint16)
        Image.fromarray(steps).save(folder / f"results/depth{number:06}.png")
        rows.append(" ".join(f"{v:.18e}" for v in frame.camera.world_from_camera.ravel()))
    (folder / "traj.txt").write_text("\n".join(rows) + "\n")
    matrix = intrinsics(frame)
    camera = {"fx": matrix[0, 0], "fy": matrix[1, 1], "scale": 6553.5}
    camera |= {"cx": matrix[0, 2], "cy": matrix[1, 2]}
    camera |= {"w": frame.camera.width, "h": frame.camera.height}
    (folder.parent / "cam_params.json").write_text(json.dumps({"camera": camera}))
    return folder
