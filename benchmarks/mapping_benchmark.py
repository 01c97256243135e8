"""Benchmark of mapping: accuracy, number of Gaussians and time, as markdown tables.

python benchmarks/mapping_benchmark.py --preset fast balanced             # ten simulated rooms
python benchmarks/mapping_benchmark.py --split test --preset fast         # ten others, for reports
python benchmarks/mapping_benchmark.py --dataset DIR --preset balanced    # a data set of your own
python benchmarks/mapping_benchmark.py --rooms kitchen_0 --without-depth  # from its images alone
python benchmarks/mapping_benchmark.py --rooms kitchen_0 --set growth=0   # with another setting

Each room is recorded once with the errors of a Kinect and once without, into out/benchmark. Maps
are made from the first recording and evaluated on test frames (every 16th) of the second, at true
poses; these frames neither trained the map nor ended the optimization. Leave the machine idle
meanwhile.
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import subprocess
import sys
from pathlib import Path
from statistics import mean
from typing import Any

from gslts_bench.homes import SPLITS
from gslts_bench.provenance import describe_machine

ROOMS = [
    *(("kitchen", number) for number in range(4)),
    *(("living_room", number) for number in range(3)),
    *(("bedroom", number) for number in range(3)),
]
"""Type of each room, and its seed within the split of seeds."""
NOISES = ("kinect", "none")
"""Sensor models of the two recordings: to map, and to evaluate."""
FRAMES = 200
"""Number of frames of a recording."""


def gslts(*arguments: object) -> str:
    """Run a command of gslts and return its output."""
    command = [sys.executable, "-c", "from gslts.cli import main; main()", *map(str, arguments)]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    return done.stdout


def record(folder: Path, room_type: str, seed: int, noise: str) -> Path:
    """Record a room unless it was recorded before; return the folder of the recording."""
    path = folder / f"{room_type}_{seed}_{noise}"
    if not path.exists():
        options = ("--frames", FRAMES, "--noise", noise, "--out", path)
        gslts("sim", "capture", room_type, seed, *options)
    return path


def without_depth(dataset: Path) -> Path:
    """Return a copy of a recording without depth."""
    path = dataset.with_name(f"{dataset.name}_photographs")
    path.mkdir(exist_ok=True)
    whole = json.loads((dataset / "transforms.json").read_text())
    for frame in whole["frames"]:
        frame.pop("depth_file_path", None)
    (path / "transforms.json").write_text(json.dumps(whole))
    if not (path / "images").exists():
        (path / "images").symlink_to(Path("..") / dataset.name / "images")
    return path


def map_and_evaluate(
    dataset: Path, clean: Path, preset: str, settings: list[str], out: Path
) -> dict[str, Any]:
    """Map a recording and evaluate the map on the test frames of the recording without noise."""
    # Left by an earlier run, finished or stopped.
    shutil.rmtree(out, ignore_errors=True)
    out.with_name(f"{out.name}.checkpoint.npz").unlink(missing_ok=True)
    options = [word for setting in settings for word in ("--set", setting)]
    gslts("map", dataset, "--preset", preset, *options, "--out", out)
    manifest = json.loads((out / "manifest.json").read_text())
    result: dict[str, Any] = json.loads(gslts("eval", out, clean, "--json"))
    result["seconds"] = sum(s for stage, s in manifest["seconds"].items() if stage != "evaluation")
    result["variants"] = {
        variant["name"]: variant["validation_psnr_db"] for variant in manifest["variants"]
    }
    return result


def row(name: str, result: dict[str, Any]) -> str:
    """Return a row of the table."""
    qualities = [result[poses] for poses in ("given", "by_neighbours", "refined")]
    psnrs = " | ".join("" if q is None else f"{q['psnr_db']:.2f}" for q in qualities)
    given, refined = qualities[0], qualities[2]
    depths_m = [quality["depth_l1_m"] for quality in (given, refined)]
    depths = " | ".join("" if depth_m is None else f"{100 * depth_m:.2f}" for depth_m in depths_m)
    half = result["variants"].get("half")
    change = "" if half is None else f"{half - result['variants']['chosen']:+.2f}"
    return (
        f"| {name} | {psnrs} | {given['ssim']:.3f} | {refined['ssim']:.3f} | {depths} | "
        f"{result['gaussians']:.0f} | {change} | {result['seconds']:.0f} |"
    )


def mean_of(results: list[dict[str, Any]]) -> dict[str, Any]:
    """Return means of all numbers; None where a result lacks the number."""
    whole: dict[str, Any] = {}
    for name in results[0]:
        values = [result.get(name) for result in results]
        whole[name] = None
        if all(isinstance(value, dict) for value in values):
            whole[name] = mean_of(values)
        elif all(isinstance(value, int | float) for value in values):
            whole[name] = mean(values)
    return whole


HEADER = (
    "| | PSNR, dB, poses given | by neighbours | refined | SSIM given | refined | depth, cm, given "
    "| refined | Gaussians | half, dB | s |\n|" + " --- |" + " ---: |" * 10
)
"""Head of the table."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--preset", nargs="+", default=["balanced"])
    names = [f"{kind}_{number}" for kind, number in ROOMS]
    parser.add_argument("--rooms", nargs="+", choices=names, default=names)
    parser.add_argument(
        "--split",
        choices=SPLITS,
        default="development",
        help="Split of the seeds of rooms; numbers of --rooms count from its first seed.",
    )
    parser.add_argument("--dataset", type=Path, help="Data set instead of simulated rooms.")
    parser.add_argument("--set", nargs="+", default=[], help="Settings, such as growth=0.")
    parser.add_argument("--without-depth", action="store_true", help="Map from images alone.")
    parser.add_argument("--out", type=Path, default=Path("out/benchmark"))
    options = parser.parse_args()
    machine = describe_machine()
    print(f"{machine['cpu']}, {machine['cores']} cores")
    for preset in options.preset:
        print(f"\n`{preset}`\n\n{HEADER}")
        results = []
        if options.dataset is not None:
            pairs = [(options.dataset.name, options.dataset, options.dataset)]
        else:
            first = SPLITS[options.split].start
            pairs = [
                (
                    f"{kind} {first + number}",
                    *(record(options.out, kind, first + number, noise) for noise in NOISES),
                )
                for kind, number in ROOMS
                if f"{kind}_{number}" in options.rooms
            ]
        for name, dataset, clean in pairs:
            if options.without_depth:
                dataset = without_depth(dataset)
            out = options.out / "_".join(["map", dataset.name, preset, *options.set])
            results.append(map_and_evaluate(dataset, clean, preset, options.set, out))
            print(row(name, results[-1]), flush=True)
        print(row("mean", mean_of(results)))
    peak_mib = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"peak memory of a process: {peak_mib:.0f} MiB")


if __name__ == "__main__":
    main()
