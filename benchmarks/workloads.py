"""The fixed workloads of the benchmarks as files: the rooms of `gslts_bench.synthetic_rooms`.

File layout (little-endian, no padding), one file a workload, `<name>.gslts-workload`:

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
    python benchmarks/workloads.py --check    # also counts visible Gaussians and blends
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gslts_bench.synthetic_rooms import NEAR_M, Room, make_room

REPOSITORY = Path(__file__).resolve().parents[1]
FOLDER = REPOSITORY / "build" / "bench" / "workloads"

MAGIC = b"GSLTSWL1"


@dataclass(frozen=True)
class ExpectedCounts:
    """Counts of the experiment that set the targets."""

    visible: float
    blends: float


EXPECTED_COUNTS = {
    "S": ExpectedCounts(29.6e3, 2.03e6),
    "M": ExpectedCounts(109e3, 7.03e6),
    "L": ExpectedCounts(570e3, 23.2e6),
}


def write_workload(room: Room, path: Path) -> None:
    """Writes the layout described above, replacing the file at once or not at all."""
    gaussian_map, camera = room.gaussian_map, room.camera
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    with partial.open("wb") as file:
        file.write(MAGIC)
        file.write(np.array([gaussian_map.size, camera.width, camera.height], "<u8").tobytes())
        intrinsics = [camera.fx, camera.fy, camera.cx, camera.cy, NEAR_M]
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
    """File of workload `name`."""
    return folder / f"{name}.gslts-workload"


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", default=[], help="S, M, L (default: all)")
    parser.add_argument("--check", action="store_true", help="count and compare; slow for L")
    parser.add_argument("--folder", type=Path, default=FOLDER)
    args = parser.parse_args()
    for name in args.names or EXPECTED_COUNTS:
        room = make_room(name)
        write_workload(room, workload_path(name, args.folder))
        if args.check:
            from workload_counts import count, report

            print(report(name, count(room), EXPECTED_COUNTS[name]), flush=True)


if __name__ == "__main__":
    main()
