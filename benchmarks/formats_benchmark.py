"""Sizes and times of the file formats of a map; prints a Markdown table.

python benchmarks/formats_benchmark.py out/map --gaussians 500000    # a minute or two

The Gaussians of a map are repeated, room beside room, until they are as many as asked for. Times are
CPU times of the whole call, with reading and writing the file, the median of `RUNS`.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.io.map_files import READ_SUFFIXES, read_map_file, write_map_file
from gslts.store.map_folder import read_map

RUNS = 3


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("map", type=Path)
    parser.add_argument("--gaussians", type=int, default=500_000)
    arguments = parser.parse_args()
    source = read_map(arguments.map)
    gaussian_map = repeat_map(source, arguments.gaussians)
    print(f"{source.size} Gaussians of SH degree {source.sh_degree}, repeated to {gaussian_map.size}")
    print("| file | bytes a Gaussian | PLY / size, map itself | export | import | memory |")
    print("| :-- | --: | --: | --: | --: | --: |")
    with tempfile.TemporaryDirectory() as folder:
        ply = Path(folder) / "map.ply"
        write_map_file(source, ply)
        for version, suffix in ((4, ".ply"), (4, ".glb"), (4, ".spz"), (3, ".spz")):
            small, path = Path(folder) / f"small{suffix}", Path(folder) / f"large{suffix}"
            write_map_file(source, small, spz_version=version)
            ratio = ply.stat().st_size / small.stat().st_size
            size = small.stat().st_size / source.size
            export_s = cpu_s(lambda: write_map_file(gaussian_map, path, spz_version=version))
            import_s = cpu_s(lambda: read_map_file(path))
            peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            name = f"`.spz`, version {version}" if suffix == ".spz" else f"`{suffix}`"
            print(
                f"| {name} | {size:.1f} | {ratio:.1f} | {export_s:.2f} s | {import_s:.2f} s | "
                f"{peak_mib:.0f} MiB |",
                flush=True,
            )


if __name__ == "__main__":
    assert set(READ_SUFFIXES) == {".ply", ".glb", ".spz"}
    main()
