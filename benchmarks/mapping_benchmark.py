"""How good maps become, how many Gaussians they take and how long: prints markdown tables.

python benchmarks/mapping_benchmark.py --preset fast balanced             # ten simulated rooms
python benchmarks/mapping_benchmark.py --dataset DIR --preset balanced    # a data set of your own
python benchmarks/mapping_benchmark.py --rooms kitchen_0 --without-depth  # of its photographs alone
python benchmarks/mapping_benchmark.py --rooms kitchen_0 --set growth=0   # with another setting

Rooms are recorded once, with the errors of a Kinect and without any, into out/benchmark; maps are
made of the former and judged by the clean pictures of the frames that were kept aside, at the poses
where these were taken. Leave the machine alone meanwhile.
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

from gslts_bench.provenance import describe_machine

ROOMS = [
    *(("kitchen", seed) for seed in range(4)),
    *(("living_room", seed) for seed in range(3)),
    *(("bedroom", seed) for seed in range(3)),
]
NOISES = ("kinect", "none")
FRAMES = 200


def gslts(*arguments: object) -> str:
    command = [sys.executable, "-c", "from gslts.cli import main; main()", *map(str, arguments)]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    return done.stdout


def recorded(folder: Path, room_type: str, seed: int, noise: str) -> Path:
    path = folder / f"{room_type}_{seed}_{noise}"
    if not path.exists():
        options = ("--frames", FRAMES, "--noise", noise, "--out", path)
        gslts("sim", "capture", room_type, seed, *options)
    return path


def photographs(dataset: Path) -> Path:
    """The same without depth."""
    path = dataset.with_name(f"{dataset.name}_photographs")
    path.mkdir(exist_ok=True)
    whole = json.loads((dataset / "transforms.json").read_text())
    for frame in whole["frames"]:
        frame.pop("depth_file_path", None)
    (path / "transforms.json").write_text(json.dumps(whole))
    if not (path / "images").exists():
        (path / "images").symlink_to(Path("..") / dataset.name / "images")
    return path


def mapped(
    dataset: Path, judge: Path, preset: str, settings: list[str], out: Path
) -> dict[str, Any]:
    """The judgement, and what it took."""
    # What an earlier run, finished or stopped, left behind.
    shutil.rmtree(out, ignore_errors=True)
    out.with_name(f"{out.name}.checkpoint.npz").unlink(missing_ok=True)
    options = [word for setting in settings for word in ("--set", setting)]
    gslts("map", dataset, "--preset", preset, *options, "--out", out)
    manifest = json.loads((out / "manifest.json").read_text())
    result: dict[str, Any] = json.loads(gslts("eval", out, judge, "--json"))
    result["seconds"] = sum(s for stage, s in manifest["seconds"].items() if stage != "judging")
    result["variants"] = {one["name"]: one["psnr_db"] for one in manifest["variants"]}
    return result


def row(name: str, result: dict[str, Any]) -> str:
    ways = [result[way] for way in ("given", "by_neighbours", "refined")]
    psnrs = " | ".join("" if way is None else f"{way['psnr_db']:.2f}" for way in ways)
    given, refined = ways[0], ways[2]
    depths_m = [way["depth_l1_m"] for way in (given, refined)]
    depths = " | ".join("" if depth_m is None else f"{100 * depth_m:.2f}" for depth_m in depths_m)
    half = result["variants"].get("half")
    change = "" if half is None else f"{half - result['variants']['chosen']:+.2f}"
    return (
        f"| {name} | {psnrs} | {given['ssim']:.3f} | {refined['ssim']:.3f} | {depths} | "
        f"{result['gaussians']:.0f} | {change} | {result['seconds']:.0f} |"
    )


def mean_of(results: list[dict[str, Any]]) -> dict[str, Any]:
    """Numbers as means; what one was not judged by is None."""
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--preset", nargs="+", default=["balanced"])
    names = [f"{kind}_{seed}" for kind, seed in ROOMS]
    parser.add_argument("--rooms", nargs="+", choices=names, default=names)
    parser.add_argument("--dataset", type=Path, help="Instead of simulated rooms.")
    parser.add_argument("--set", nargs="+", default=[], help="Settings, such as growth=0.")
    parser.add_argument("--without-depth", action="store_true", help="Photographs alone.")
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
            pairs = [
                (f"{kind} {seed}", *(recorded(options.out, kind, seed, n) for n in NOISES))
                for kind, seed in ROOMS
                if f"{kind}_{seed}" in options.rooms
            ]
        for name, dataset, judge in pairs:
            if options.without_depth:
                dataset = photographs(dataset)
            out = options.out / "_".join(["map", dataset.name, preset, *options.set])
            results.append(mapped(dataset, judge, preset, options.set, out))
            print(row(name, results[-1]), flush=True)
        print(row("mean", mean_of(results)))
    peak_mib = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"most memory of a process: {peak_mib:.0f} MiB")


if __name__ == "__main__":
    main()
