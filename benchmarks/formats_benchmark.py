"""Sizes and times of the file formats of a map; prints a Markdown table.

python benchmarks/formats_benchmark.py out/map --gaussians 500000    # a minute or two

Sizes are those of the map itself. For times its Gaussians are repeated, room beside room, until
they are as many as asked for. Times are CPU times of the whole call, with reading and writing the
file, the median of `RUNS`.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.io.map_files import read_map_file, write_map_file
from gslts.rendering.metrics import psnr_db
from gslts.rendering.rasterizer import render
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import read_map

RUNS = 3
CAMERA_STEP = 15
"""Every so many cameras of the map show the PSNR of renderings to those of the map itself."""


def repeat_map(gaussian_map: GaussianMap, size: int) -> GaussianMap:
    """Repeat a map along x until it has the given number of Gaussians."""
    rows = np.arange(size) % gaussian_map.size
    width_m = np.ptp(gaussian_map.means[:, 0])
    means = gaussian_map.means[rows].copy()
    means[:, 0] += width_m * (np.arange(size) // gaussian_map.size)
    return GaussianMap(
        means=means,
        quats=gaussian_map.quats[rows],
        log_scales=gaussian_map.log_scales[rows],
        logit_opacities=gaussian_map.logit_opacities[rows],
        sh=gaussian_map.sh[rows],
    )


def cpu_s(call: Callable[[], object]) -> float:
    """Return the median CPU time of a call, s."""
    times = []
    for _ in range(RUNS):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    return median(times)


def rendering_psnr_db(expected: GaussianMap, actual: GaussianMap, cameras: list[Camera]) -> float:
    """Return the mean PSNR of renderings to those of another map, dB."""
    images = [[render(m, camera).rgb for m in (expected, actual)] for camera in cameras]
    return float(np.mean([psnr_db(*pair) for pair in images]))


def row(
    source: GaussianMap,
    large: GaussianMap,
    cameras: list[Camera],
    suffix: str,
    version: int,
    folder: Path,
) -> str:
    """Measure a format; return its row of the table."""
    small_path, path, ply = (folder / name for name in (f"small{suffix}", f"a{suffix}", "map.ply"))
    write_map_file(source, ply)
    write_map_file(source, small_path, spz_version=version)
    read = read_map_file(small_path)
    quality = f"{rendering_psnr_db(source, read, cameras):.1f} dB" if suffix == ".spz" else ""
    small_bytes, ply_bytes = small_path.stat().st_size, ply.stat().st_size
    export_s = cpu_s(lambda: write_map_file(large, path, spz_version=version))
    import_s = cpu_s(lambda: read_map_file(path))
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    name = f"`.spz`, version {version}" if suffix == ".spz" else f"`{suffix}`"
    cells = [
        name,
        f"{small_bytes / source.size:.1f}",
        f"{ply_bytes / small_bytes:.1f}",
        quality,
        f"{export_s:.2f} s",
        f"{import_s:.2f} s",
        f"{peak_mib:.0f} MiB",
    ]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("map", type=Path)
    parser.add_argument("--gaussians", type=int, default=500_000)
    parser.add_argument("--degree", type=int, default=3, help="maximum degree of harmonics")
    arguments = parser.parse_args()
    source = read_map(arguments.map)
    source = replace(source, sh=source.sh[:, : (arguments.degree + 1) ** 2])
    cameras = list(cameras_of_map(arguments.map).values())[::CAMERA_STEP]
    large = repeat_map(source, arguments.gaussians)
    print(f"{source.size} Gaussians of SH degree {source.sh_degree}, repeated to {large.size}")
    print("| file | bytes a Gaussian | PLY / size | PSNR | export | import | peak memory |")
    print("| :-- | --: | --: | --: | --: | --: | --: |")
    with tempfile.TemporaryDirectory() as folder:
        for suffix, version in ((".ply", 4), (".glb", 4), (".spz", 4), (".spz", 3)):
            print(row(source, large, cameras, suffix, version, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
