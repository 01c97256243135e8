"""Compares a map, its changes and an update with AVX-512 and with AVX2.

Runs `gslts map`, `detect` and `update` on one input several times: as the machine is, twice; with
every library restricted to AVX2; and with one library restricted at a time, which shows whose
results differ. Needs a machine with AVX-512 and two short recordings, before and after a change:

    gslts sim tasks living_room --count 3 --out out/tasks
    gslts sim replay out/tasks/0001_*.json --out out/before --frames 40
    gslts sim replay out/tasks/0001_*.json --changed --out out/after
    python benchmarks/instruction_sets.py out/before out/after --json out/instruction_sets.json
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from tqdm import tqdm

from gslts.store.map_folder import open_map

AVX2_ONLY = {
    "gslts": {"GSLTS_SIMD": "avx2"},
    "numpy": {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"},
    "OpenBLAS": {"OPENBLAS_CORETYPE": "Haswell"},
    "OpenCV": {"OPENCV_CPU_DISABLE": "AVX512-SKX"},
    "torch": {"ATEN_CPU_CAPABILITY": "avx2", "ONEDNN_MAX_CPU_ISA": "AVX2"},
    "glibc": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX512VL,-AVX512BW,-AVX512DQ"},
}
"""Environment variables that restrict each library to AVX2."""


def runs() -> dict[str, dict[str, str]]:
    """Return the environments to compare, by name; the first is the machine as it is."""
    everything = {
        name: value for variables in AVX2_ONLY.values() for name, value in variables.items()
    }
    return {"as it is": {}, "again": {}, "all": everything, **AVX2_ONLY}


def digest(*arrays: np.ndarray) -> str:
    """Return a short hash of the bits of arrays."""
    return hashlib.sha256(
        b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)
    ).hexdigest()[:12]


def pipeline(before: Path, after: Path, out: Path, variables: dict[str, str]) -> dict[str, str]:
    """Make a map, detect changes and update it; return the hash of each result."""
    environment = {**os.environ, **variables}

    def gslts(*words: str | Path) -> str:
        command = [sys.executable, "-c", "from gslts.cli import main; main()", *map(str, words)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        return done.stdout if done.returncode == 0 else f"{done.returncode}: {done.stderr[-300:]}"

    quickly = ["--preset", "fast", "--iterations", "200", "--every", "3"]
    gslts("map", before, *quickly, "--out", out / "map")
    detected = gslts("detect", out / "map", after, "--json")
    updated = gslts("update", out / "map", "--frames", after)
    hashes = {"detect": hashlib.sha256(detected.encode()).hexdigest()[:12]}
    with open_map(out / "map") as store:
        for version in store.versions():
            gaussians = store.read(version.number)
            hashes[f"version {version.number}"] = digest(
                gaussians.means,
                gaussians.quats,
                gaussians.log_scales,
                gaussians.logit_opacities,
                gaussians.sh,
            )
    hashes["update"] = updated.strip().replace(str(out), "MAP").splitlines()[-1][:70]
    return hashes


def main() -> None:
    """Run the pipelines and print which results equal those of the machine as it is."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--only", nargs="*", choices=list(runs()), help="environments to run")
    args = parser.parse_args()
    results: dict[str, dict[str, str]] = {}
    for name in tqdm(args.only or runs(), unit="run"):
        with tempfile.TemporaryDirectory() as folder:
            results[name] = pipeline(args.before, args.after, Path(folder), runs()[name])
    first = next(iter(results.values()))
    for name, hashes in results.items():
        marks = [
            f"{what} {'same' if hashes.get(what) == first[what] else 'DIFFERS'}" for what in first
        ]
        print(f"{name:10}", ", ".join(marks))
    if args.json:
        args.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
