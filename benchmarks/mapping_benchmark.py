"""How good maps become, how many Gaussians they take and how long: prints markdown tables.

python benchmarks/mapping_benchmark.py --preset fast balanced          # ten simulated rooms
python benchmarks/mapping_benchmark.py --dataset DIR --preset balanced  # a data set of your own

Rooms are recorded once, with the errors of a Kinect and without any, into out/benchmark; maps are
made of the former and judged by the clean pictures of the frames that were kept aside, at the poses
where these were taken. Leave the machine alone meanwhile.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
from pathlib import Path
from statistics import mean
from typing import Any

from machine import describe_machine

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


def mapped(dataset: Path, judge: Path, preset: str, out: Path) -> dict[str, Any]:
    """The judgement, and what it took."""
    gslts("map", dataset, "--preset", preset, "--out", out)
    manifest = json.loads((out / "manifest.json").read_text())
    result: dict[str, Any] = json.loads(gslts("eval", out, judge, "--json"))
    result["seconds"] = sum(s for stage, s in manifest["seconds"].items() if stage != "judging")
    result["variants"] = {one["name"]: one["psnr_db"] for one in manifest["variants"]}
    return result


def row(name: str, result: dict[str, Any]) -> str:
    ways = [result[way] for way in ("given", "by_neighbours", "refined")]
    psnrs = " | ".join("" if way is None else f"{way['psnr_db']:.2f}" for way in ways)
    given, refined = ways[0], ways[2]
    half = result["variants"].get("half")
    change = "" if half is None else f"{half - result['variants']['chosen']:+.2f}"
    return (
        f"| {name} | {psnrs} | {given['ssim']:.3f} | {refined['ssim']:.3f} | "
        f"{100 * given['depth_l1_m']:.2f} | {100 * refined['depth_l1_m']:.2f} | "
        f"{result['gaussians']} | {change} | {result['seconds']:.0f} |"
    )


HEADER = (
    "| | PSNR, dB, poses given | by neighbours | refined | SSIM given | refined | depth, cm, given "
    "| refined | Gaussians | half, dB | s |\n|" + " --- |" + " ---: |" * 10
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--preset", nargs="+", default=["balanced"])
    parser.add_argument("--rooms", type=int, default=len(ROOMS), help="The first so many.")
    parser.add_argument("--dataset", type=Path, help="Instead of simulated rooms.")
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
                for kind, seed in ROOMS[: options.rooms]
            ]
        for name, dataset, judge in pairs:
            out = options.out / f"map_{dataset.name}_{preset}"
            results.append(mapped(dataset, judge, preset, out))
            print(row(name, results[-1]), flush=True)
        given = [result["given"]["psnr_db"] for result in results]
        print(f"\nmean PSNR with poses as given {mean(given):.2f} dB")
    peak_mib = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"most memory of a process: {peak_mib:.0f} MiB")


if __name__ == "__main__":
    main()
