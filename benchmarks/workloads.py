"""Workloads of the C++ benchmarks as files: the rooms of `gslts_bench.synthetic_rooms`.

File layout (little-endian, no padding), one file per workload, `<name>.gslts-workload`:

    magic              8 bytes      b"GSLTSWL1"
    size, width, height  3 x uint64   N Gaussians, image in pixels
    fx, fy, cx, cy     4 x float64  px
    near_m             float64
    world_from_camera  16 x float64 row-major 4 x 4, OpenCV camera axes
    means              float32 [N,3]
    quats              float32 [N,4]  wxyz
    log_scales         float32 [N,3]
    logit_opacities    float32 [N]
    sh_dc              float32 [N,1,3]
    sh_rest            float32 [N,15,3]  degrees 1 to 3

SH degree 0 is the same scene without `sh_rest`.

    python benchmarks/workloads.py            # writes build/bench/workloads/
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from gslts_bench.synthetic_rooms import NEAR_PLANE_M, SIZES, Room, make_room

REPOSITORY = Path(__file__).resolve().parents[1]
FOLDER = REPOSITORY / "build" / "bench" / "workloads"

MAGIC = b"GSLTSWL1"
"""First bytes of a file: its format and version, as read by `workload.cpp`."""


def write_workload(room: Room, path: Path) -> None:
    """Write a room in the layout described above, at once or not at all.

    Args:
        room: Map and camera.
        path: File to write or replace.
    """
    gaussian_map, camera = room.gaussian_map, room.camera
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    with partial.open("wb") as file:
        file.write(MAGIC)
        file.write(np.array([gaussian_map.size, camera.width, camera.height], "<u8").tobytes())
        intrinsics = [camera.fx, camera.fy, camera.cx, camera.cy, NEAR_PLANE_M]
        file.write(np.array(intrinsics, "<f8").tobytes())
        file.write(camera.world_from_camera.astype("<f8").tobytes())
        for array in (
            gaussian_map.means,
            gaussian_map.quats,
            gaussian_map.log_scales,
            gaussian_map.logit_opacities,
            gaussian_map.sh[:, :1],
            gaussian_map.sh[:, 1:],
        ):
            file.write(np.ascontiguousarray(array, "<f4").tobytes())
    partial.replace(path)


def workload_path(name: str, folder: Path = FOLDER) -> Path:
    """Return the file of a workload.

    Args:
        name: S, M or L.
        folder: Folder of the workloads.

    Returns:
        Path of the file, which need not exist.
    """
    return folder / f"{name}.gslts-workload"


def main() -> None:
    """Write the workloads that are named on the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", default=[], help="S, M, L (default: all)")
    parser.add_argument("--folder", type=Path, default=FOLDER)
    args = parser.parse_args()
    for name in args.names or SIZES:
        write_workload(make_room(name), workload_path(name, args.folder))


if __name__ == "__main__":
    main()
