"""The command `gslts tradeoff`."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli import output
from gslts.cli.jobs import NumberOfJobs, Scheduler, fail, progress_bar, workers_of
from gslts.cli.mapping import Preset

if TYPE_CHECKING:
    from gslts.core.camera import Camera
    from gslts.core.gaussian_map import GaussianMap
    from gslts.datasets import Dataset
    from gslts.mapping.frames import FrameSplit
    from gslts_bench.tradeoff.mapping import MappingPoint
    from gslts_bench.tradeoff.units import PointUnit

# What a command needs is imported inside it, so that `gslts --help` answers at once.


class RoomName(StrEnum):
    """The rooms of `gslts_bench.synthetic_rooms`."""

    S = "S"
    M = "M"
    L = "L"


def tradeoff(
    out: Annotated[Path, typer.Option(help="Folder for tables and plots.")],
    mapped: Annotated[
        Path | None,
        typer.Argument(metavar="MAP", help="Folder of a map, or a file of 3DGS."),
    ] = None,
    dataset: Annotated[
        Path | None,
        typer.Argument(metavar="DATASET", help="Data set that it was made from, as for gslts map."),
    ] = None,
    seconds: Annotated[
        str, typer.Option(help="Budgets of maps of DATASET, separated by commas.")
    ] = "10,20,45,90",
    preset: Annotated[
        Preset, typer.Option(help="Preset of the maps of DATASET.")
    ] = Preset.BALANCED,
    scene: Annotated[RoomName, typer.Option(help="Synthetic room to render.")] = RoomName.M,
    threads: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="0 means one per hardware thread. By default, maps are made with all of them, as "
            "jobs with one, and rendering is measured on one.",
        ),
    ] = None,
    rounds: Annotated[
        int, typer.Option(min=1, help="Number of times each setting is measured.")
    ] = 15,
    map_path: Annotated[
        Path | None, typer.Option("--map", help="A map to render instead: its folder or file.")
    ] = None,
    pose: output.Pose = None,
    jobs: NumberOfJobs = None,
    scheduler: Scheduler = None,
) -> None:
    """Measure accuracy against time, number of Gaussians and settings of the renderer.

    Given MAP and DATASET, maps are made from scratch in several budgets, and the map is refined
    with an eighth to double as many Gaussians; all are evaluated on test frames. Settings of the
    renderer are measured on a map from --pose, or from its first camera; without any map, in a
    synthetic room.

    With --jobs or --scheduler, each map of DATASET is a job. An interrupted run continues where it
    stopped; OUT.points holds its results until the end.

    Example: gslts tradeoff --scene M --out out/tradeoff

    Example: gslts tradeoff out/map out/kitchen_3 --out out/tradeoff
    """
    from gslts.store.map_folder import read_map
    from gslts_bench.synthetic_rooms import NEAR_PLANE_M, make_room

    if mapped is not None:
        if dataset is None or map_path is not None:
            raise ValueError("give MAP and DATASET, or --map alone")
        workers = None if jobs is None and scheduler is None else workers_of(jobs, scheduler)
        _measure_mapping(
            mapped, dataset, out, _budgets(seconds), preset, threads, rounds, pose, workers
        )
        return
    if jobs is not None or scheduler is not None:
        raise ValueError("--jobs and --scheduler are for maps of a data set: give MAP and DATASET")
    render_threads = 1 if threads is None else threads
    if map_path is not None:
        gaussian_map, camera = read_map(map_path), output.find_camera(map_path, pose)
        title, stem = f"Map {map_path}", f"tradeoff_{map_path.resolve().stem}"
        _measure_rendering(gaussian_map, camera, title, out, stem, render_threads, rounds)
    elif pose is not None:
        raise ValueError("--pose is for maps: give --map")
    else:
        room, title = make_room(scene), f"Room {scene}"
        stem = f"tradeoff_{scene}"
        _measure_rendering(
            room.gaussian_map, room.camera, title, out, stem, render_threads, rounds, NEAR_PLANE_M
        )


def _measure_rendering(
    gaussian_map: GaussianMap,
    camera: Camera,
    title: str,
    out: Path,
    stem: str,
    threads: int,
    rounds: int,
    near_m: float | None = None,
) -> None:
    """Measure the renderer, and write a table and a plot."""
    from tqdm import tqdm

    from gslts.rendering.rasterizer import RenderOptions
    from gslts_bench.tradeoff import rendering as tradeoff
    from gslts_bench.tradeoff.rendering_plot import write_plot

    out.mkdir(parents=True, exist_ok=True)
    points = tradeoff.measure(
        gaussian_map,
        camera,
        near_m=RenderOptions().near_m if near_m is None else near_m,
        threads=threads,
        rounds=rounds,
        progress=lambda steps: tqdm(steps, desc=title, unit="round", disable=None),
    )
    size = f"{gaussian_map.size:,} Gaussians, {camera.width} x {camera.height} px"
    csv_path, plot_path = out / f"{stem}.csv", out / f"{stem}.png"
    tradeoff.write_csv(points, csv_path)
    write_plot(points, f"{title}: {size}, {threads} thread(s)", plot_path)
    default = points[0]
    typer.echo(
        f"default: {default.forward_ms:.2f} ms, {default.psnr_db:.1f} dB, "
        f"{'on' if default.on_front else 'NOT on'} the Pareto front"
    )
    typer.echo(f"wrote {csv_path} and {plot_path}")


def _measure_mapping(
    map_path: Path,
    dataset: Path,
    out: Path,
    budgets_s: list[float],
    preset: Preset,
    threads: int | None,
    rounds: int,
    pose: str | None,
    workers: int | str | None,
) -> None:
    """Measure renderer and mapping; without workers, the table grows with each result."""
    import json
    import shutil
    from dataclasses import asdict

    from tqdm import tqdm

    from gslts.datasets import open_dataset
    from gslts.io.atomic_files import empty_folder
    from gslts.mapping.config import PRESETS
    from gslts.store.map_folder import read_map
    from gslts_bench.provenance import describe_run
    from gslts_bench.tradeoff.mapping_plot import write_plot
    from gslts_bench.tradeoff.rendering import write_csv
    from gslts_bench.tradeoff.units import units_of

    gaussian_map, opened = read_map(map_path), open_dataset(dataset)
    split = _split_of_map(map_path, gaussian_map, opened, threads or 0)
    first = next(iter(split.training.values()))
    camera = output.find_camera(map_path, pose) if pose else first.camera()
    empty_folder(out)
    all_or_one = 0 if workers is None else 1
    config = PRESETS[preset].model_copy(
        update={"threads": all_or_one if threads is None else threads}
    )
    kept = out.with_name(f"{out.name}.points")
    units = units_of(map_path, dataset, config, budgets_s, None if workers is None else kept)
    csv_path, json_path, plot_path = (
        out / f"tradeoff_mapping.{kind}" for kind in ("csv", "json", "png")
    )
    measured = _points(units, gaussian_map, split, workers)
    del split
    points: list[MappingPoint] = []
    for point in measured:
        points.append(point)
        write_csv(points, csv_path)
        tqdm.write(_line(point))
    stem, render_threads = "tradeoff_renderer", 1 if threads is None else threads
    _measure_rendering(gaussian_map, camera, f"Map {map_path}", out, stem, render_threads, rounds)
    result = {
        **describe_run(),
        "map": str(map_path),
        "dataset": opened.name,
        "preset": preset.value,
        "config": config.model_dump(),
        "points": [asdict(point) for point in points],
    }
    json_path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    write_plot(points, f"Maps of {opened.name}, preset {preset}; the map is {map_path}", plot_path)
    shutil.rmtree(kept, ignore_errors=True)
    typer.echo(f"wrote {csv_path}, {json_path} and {plot_path}")


def _points(
    units: list[PointUnit],
    gaussian_map: GaussianMap,
    split: FrameSplit | None,
    workers: int | str | None,
) -> Iterator[MappingPoint]:
    """Measure maps one after the other here, or as jobs of workers."""
    from tqdm import tqdm

    from gslts.fleet.jobs import run_units
    from gslts_bench.tradeoff.units import point_of

    if workers is None:
        for unit in tqdm(units, desc="maps", unit="map", disable=None):
            if unit.budget_s is not None:
                split = None  # Maps from scratch read the frames themselves.
            yield unit.measure(gaussian_map, split)
        return
    del split
    with progress_bar("maps") as bar:
        found = run_units(units, workers, bar)
    last = [found[unit.name][-1] for unit in units]
    fail({result["id"]: result["error"] for result in last if "error" in result})
    yield from map(point_of, last)


def _split_of_map(
    map_path: Path, gaussian_map: GaussianMap, opened: Dataset, threads: int
) -> FrameSplit:
    """Read the frames that trained the map and those that did not; check that they show it."""
    from tqdm import tqdm

    from gslts.mapping.evaluation.held_out import TrainingRecord
    from gslts_bench.tradeoff import mapping as bench

    split = bench.split_of(
        opened,
        TrainingRecord.read(map_path),
        lambda frames: tqdm(frames, desc="reading", unit="frame", disable=None),
    )
    opacity = bench.mean_opacity(gaussian_map, split, threads)
    if opacity < bench.MIN_OPACITY:
        raise ValueError(
            f"{map_path}: it fills {100 * opacity:.0f} % of the frames of {opened.name}; give the "
            "data set that it was made from"
        )
    return split


def _line(point: MappingPoint) -> str:
    """Format a result in one line."""
    spent = [] if point.seconds is None else [f"{point.seconds:.1f} s"]
    spent += [] if point.steps is None else [f"{point.steps} steps"]
    psnrs_db = {
        "as given": point.given_psnr_db,
        "by neighbours": point.by_neighbours_psnr_db,
        "refined": point.refined_psnr_db,
    }
    found = ", ".join(f"{poses} {db:.2f} dB" for poses, db in psnrs_db.items() if db is not None)
    return ", ".join([f"{point.name}: {point.gaussians} Gaussians", *spent]) + f"; {found}"


def _budgets(seconds: str) -> list[float]:
    """Parse the option --seconds, the shortest first."""
    try:
        budgets_s = sorted(float(part) for part in seconds.split(","))
    except ValueError:
        budgets_s = []
    if not budgets_s or not all(1 <= budget_s < float("inf") for budget_s in budgets_s):
        raise ValueError(
            f"--seconds: expected numbers of at least 1, separated by commas, got {seconds!r}"
        )
    return budgets_s
