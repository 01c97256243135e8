"""The commands `gslts bench`: how good the modules are, on many simulated homes."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gslts.cli.mapping import BAR, Preset, both_weights

if TYPE_CHECKING:
    from tqdm import tqdm

    from gslts_bench.homes import HomeSetup

# What a command needs is imported inside it, so that `gslts --help` answers at once.

bench = typer.Typer(no_args_is_help=True, help="Benchmarks on simulated homes.")

Seeds = Annotated[
    str,
    typer.Option(
        metavar="A:B",
        help="Seeds of the homes, without B; each gives a kitchen, a living room and a bedroom. "
        "From 10000 on they are kept for evaluation.",
    ),
]
Rooms = Annotated[
    list[str] | None,
    typer.Option("--room", help="Room type instead of all three; may be given again."),
]
Tasks = Annotated[int, typer.Option(min=1, help="How many, spread over the homes.")]
Jobs = Annotated[int, typer.Option(min=1, help="Processes; each works on one home at a time.")]
Json = Annotated[Path | None, typer.Option("--json", help="File for everything that was found.")]
Work = Annotated[
    Path, typer.Option(help="Folder of recordings, maps and results, which are used again.")
]
MapPreset = Annotated[Preset, typer.Option(help="Of the maps.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Of the mapping, as for gslts map."),
]
Frames = Annotated[int, typer.Option(min=9, help="Of a recording that a map is made of.")]
Size = Annotated[str, typer.Option(metavar="WxH", help="Of the images, px.")]
WORK = Path("out/bench")


@bench.callback()
def describe() -> None:
    """Benchmarks on simulated homes."""


@bench.command()
def detect(
    seeds: Seeds = "0:4",
    room: Rooms = None,
    tasks: Tasks = 300,
    jobs: Jobs = 1,
    json_path: Json = None,
    pictures: Annotated[
        Path | None, typer.Option(help="New or empty folder for overlays, right and wrong.")
    ] = None,
    trade: Annotated[
        Path | None,
        typer.Option(help="Measure speed against accuracy too; a PNG of it is written here."),
    ] = None,
    work: Work = WORK,
    preset: MapPreset = Preset.FAST,
    settings: Settings = None,
    frames: Frames = 200,
    size: Size = "640x480",
) -> None:
    """Measure change detection: one, two and three changes, and none, seen once each.

    Both strategies see the same frames; `watching` is what is confirmed over six of them. An
    interrupted run goes on where it stopped.

    Example: gslts bench detect --jobs 2 --json out/detect.json --pictures out/detect
    """
    from gslts_bench.detection import benchmark as bench_detect
    from gslts_bench.detection.plot import write_plot
    from gslts_bench.detection.tables import counted, printed
    from gslts_bench.homes import homes_of

    chosen, setup = seeds_of(seeds), setup_of(preset, settings, frames, size)
    homes = homes_of(chosen, room or [], setup, work)
    prepare(work, pictures, json_path, trade)
    units = bench_detect.units_of(homes, tasks, trade=trade is not None)
    with progress("detecting") as bar:
        outcome = bench_detect.measure(units, jobs, bar)
    summaries = outcome.summaries()
    typer.echo(f"{counted(outcome.records)}\n\n{printed(summaries)}")
    write_json(json_path, bench_detect.told(units, outcome))
    errors = outcome.errors
    if trade is not None:
        write_plot(summaries, f"Change detection: {tasks} tasks of {len(units)} home(s)", trade)
    if pictures is not None:
        with progress("drawing") as bar:
            errors |= bench_detect.draw(units, outcome, pictures, jobs, bar)
    end(errors, outcome.missing, tasks)


@bench.command()
def update(
    seeds: Seeds = "0:3",
    room: Rooms = None,
    tasks: Tasks = 160,
    jobs: Jobs = 1,
    json_path: Json = None,
    ablation: Annotated[
        bool, typer.Option("--ablation", help="Also leave out one improvement at a time.")
    ] = False,
    curve: Annotated[
        Path | None, typer.Option(help="Measure PSNR against iterations too; a PNG of it.")
    ] = None,
    curve_tasks: Annotated[int, typer.Option(min=1, help="Of how many tasks that is.")] = 18,
    pictures: Annotated[
        Path | None, typer.Option(help="New or empty folder for a picture of each task.")
    ] = None,
    lpips_backbone: Annotated[
        Path | None, typer.Option(help="Weights of torchvision's AlexNet, for LPIPS.")
    ] = None,
    lpips_heads: Annotated[
        Path | None, typer.Option(help="alex.pth of the package lpips, for LPIPS.")
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Of an update, for its seconds.")] = 1,
    work: Work = WORK,
    preset: MapPreset = Preset.BALANCED,
    settings: Settings = None,
    frames: Frames = 200,
    size: Size = "640x480",
) -> None:
    """Measure updates: none, plain fine-tuning, the paper's editing as printed, and ours.

    As in GS-LTS, changes that are not detected in the first frame are left out, and counted; test
    views are cropped to the change. An interrupted run goes on where it stopped.

    Example: gslts bench update --jobs 2 --json out/update.json --pictures out/update
    """
    from gslts_bench.homes import homes_of
    from gslts_bench.update import benchmark as bench_update
    from gslts_bench.update.plot import write_plot
    from gslts_bench.update.tables import printed

    weights = both_weights(lpips_backbone, lpips_heads)
    chosen, setup = seeds_of(seeds), setup_of(preset, settings, frames, size)
    homes = homes_of(chosen, room or [], setup, work)
    prepare(work, pictures, json_path, curve)
    drawn = 0 if curve is None else min(curve_tasks, tasks)
    units = bench_update.units_of(
        homes, tasks, ablation=ablation, curves=drawn, lpips=weights, threads=threads
    )
    with progress("updating") as bar:
        outcome = bench_update.measure(units, jobs, bar)
    content = bench_update.told(units, outcome)
    typer.echo(printed(content["summary"]))
    write_json(json_path, content)
    if curve is not None:
        write_plot(content["summary"]["curves"], f"Updates of {drawn} tasks", curve)
    if pictures is not None:
        bench_update.copy_pictures(units, outcome, pictures)
    end(outcome.errors, outcome.missing, tasks)


@bench.command()
def navigate(
    seeds: Seeds = "0:4",
    room: Rooms = None,
    episodes: Annotated[int, typer.Option(min=1, help="How many, spread over the homes.")] = 300,
    moved: Annotated[
        int,
        typer.Option(min=0, help="Objects that move after mapping, and to which a robot goes too."),
    ] = 0,
    jobs: Jobs = 1,
    json_path: Json = None,
    pictures: Annotated[
        Path | None, typer.Option(help="New or empty folder for the way of each episode.")
    ] = None,
    work: Work = WORK,
    preset: MapPreset = Preset.BALANCED,
    settings: Settings = None,
    frames: Frames = 200,
    size: Size = "640x480",
) -> None:
    """Measure navigation to objects: success rate and SPL, as in SAVN, in homes that are mapped.

    Maps know words from the labels of the simulator, which also judges success. An interrupted run
    goes on where it stopped.

    Example: gslts bench navigate --moved 60 --jobs 2 --pictures out/navigate
    """
    from gslts_bench.homes import homes_of
    from gslts_bench.navigation import benchmark as bench_navigate
    from gslts_bench.navigation.tables import printed

    chosen, setup = seeds_of(seeds), setup_of(preset, settings, frames, size)
    homes = homes_of(chosen, room or [], setup, work)
    prepare(work, pictures, json_path)
    units = bench_navigate.units_of(homes, episodes, moved)
    with progress("navigating") as bar:
        outcome = bench_navigate.measure(units, jobs, bar)
    content = bench_navigate.told(units, outcome)
    typer.echo(printed(content["summary"]))
    write_json(json_path, content)
    if pictures is not None:
        bench_navigate.copy_pictures(units, outcome, pictures)
    end(outcome.errors, 0, episodes)


@bench.command()
def series(
    seeds: Seeds = "0:1",
    room: Rooms = None,
    changes: Annotated[int, typer.Option(min=1, help="In a row, in each home.")] = 100,
    every: Annotated[
        int, typer.Option(min=1, help="Fresh views are compared after so many changes.")
    ] = 10,
    jobs: Jobs = 1,
    json_path: Json = None,
    plot: Annotated[
        Path | None, typer.Option(help="PNG of PSNR and of the number of Gaussians.")
    ] = None,
    work: Work = WORK,
    preset: MapPreset = Preset.BALANCED,
    settings: Settings = None,
    frames: Frames = 200,
    size: Size = "640x480",
) -> None:
    """Measure many changes in a row: the updated map against one built anew at the end.

    Each change starts where the one before ended, and from the map that was made of it; what is not
    detected in the first frame stays as it is, until it is seen again.

    Example: gslts bench series --room kitchen --changes 100 --plot out/series.png
    """
    from gslts_bench.homes import homes_of
    from gslts_bench.series import benchmark as bench_series
    from gslts_bench.series.report import printed, write_plot

    chosen, setup = seeds_of(seeds), setup_of(preset, settings, frames, size)
    homes = homes_of(chosen, room or [], setup, work)
    prepare(work, None, json_path, plot)
    units = [bench_series.SeriesUnit(home, changes, every) for home in homes]
    with progress("changing") as bar:
        steps, ends, failed = bench_series.measure(units, jobs, bar)
    typer.echo(printed(steps, ends))
    told = {
        "steps": [one.model_dump(mode="json") for own in steps.values() for one in own],
        "ends": [one.model_dump(mode="json") for one in ends.values()],
        "errors": failed,
    }
    write_json(json_path, told)
    if plot is not None:
        write_plot(steps, ends, plot)
    end(failed, 0, 0)


@bench.command()
def localize(
    seeds: Seeds = "0:4",
    room: Rooms = None,
    jobs: Jobs = 1,
    json_path: Json = None,
    ablation: Annotated[
        bool,
        typer.Option(
            "--ablation", help="Also refine by gradient, and with smaller and with fewer images."
        ),
    ] = False,
    trade: Annotated[
        Path | None,
        typer.Option(help="Codes of other lengths too; a PNG of accuracy, bytes and seconds."),
    ] = None,
    work: Work = WORK,
    preset: MapPreset = Preset.BALANCED,
    settings: Settings = None,
    frames: Frames = 200,
    size: Size = "640x480",
) -> None:
    """Measure localisation: boxes of all objects of the paper's twelve categories, by their names.

    Maps are taught by the labels of their frames. An interrupted run goes on where it stopped.

    Example: gslts bench localize --jobs 2 --json out/localize.json --trade out/localize.png
    """
    from gslts_bench.homes import homes_of
    from gslts_bench.queries import benchmark as bench_localize
    from gslts_bench.queries.tables import printed, write_plot

    chosen, setup = seeds_of(seeds), setup_of(preset, settings, frames, size)
    homes = homes_of(chosen, room or [], setup, work)
    prepare(work, None, json_path, trade)
    units = bench_localize.units_of(homes, trade=trade is not None, ablation=ablation)
    with progress("asking") as bar:
        outcome = bench_localize.measure(units, jobs, bar)
    content = bench_localize.told(units, outcome)
    typer.echo(printed(content["summary"]))
    write_json(json_path, content)
    if trade is not None:
        write_plot(content["summary"], trade)
    end(outcome.errors, 0, 0)


@bench.command()
def relocalize(
    seeds: Seeds = "0:4",
    room: Rooms = None,
    views: Annotated[
        int,
        typer.Option(
            min=1, help="Frames of each home as mapped, of it changed, and of other homes."
        ),
    ] = 60,
    jobs: Jobs = 1,
    json_path: Json = None,
    ablation: Annotated[
        bool, typer.Option("--ablation", help="Also leave out depth, clouds and refinement.")
    ] = False,
    trade: Annotated[
        Path | None,
        typer.Option(help="Other resolutions, corners and iterations too; a PNG of them."),
    ] = None,
    real: Annotated[
        Path | None,
        typer.Option(
            help="Instead of homes, a data set such as one of 7-Scenes: each eighth of its frames "
            "is looked for in a map made without it."
        ),
    ] = None,
    fold: Annotated[
        list[int] | None,
        typer.Option(help="Of --real, an eighth instead of all, 0 to 7; may be given again."),
    ] = None,
    work: Work = WORK,
    preset: MapPreset = Preset.BALANCED,
    settings: Settings = None,
    frames: Frames = 200,
    size: Size = "640x480",
) -> None:
    """Measure relocalization: where in the map of its home a robot looks around, or that it is not.

    Frames are taken of each home as it was mapped, after three changes, and of other homes, none of
    which may be found; in its own, the robot also tracks its pose from a start nearby. The
    simulator knows the true poses. An interrupted run goes on where it stopped.

    Example: gslts bench relocalize --jobs 2 --json out/relocalize.json --trade out/relocalize.png
    """
    from gslts_bench.homes import homes_of
    from gslts_bench.relocalization import benchmark as bench_relocalize
    from gslts_bench.relocalization.plot import write_plot
    from gslts_bench.relocalization.room import RecordedRoom

    chosen, setup = seeds_of(seeds), setup_of(preset, settings, frames, size)
    units: list[bench_relocalize.Unit] = []
    if real is None:
        if fold:
            raise ValueError("--fold is for --real")
        homes = homes_of(chosen, room or [], setup, work)
        units += bench_relocalize.units_of(homes, views, ablation=ablation, trade=trade is not None)
    elif ablation or trade is not None:
        raise ValueError("--ablation and --trade are for homes, not for --real")
    else:
        recorded = RecordedRoom.of(real, setup.mapping, work)
        units += bench_relocalize.folds_of(recorded, fold or [])
    prepare(work, None, json_path, trade)
    with progress("looking") as bar:
        outcome = bench_relocalize.measure(units, jobs, bar)
    typer.echo(bench_relocalize.tables(outcome))
    content = bench_relocalize.told(units, outcome)
    write_json(json_path, content)
    if trade is not None:
        title = f"Relocalization: {views} frames of each of {len(units)} home(s)"
        write_plot(content["summary"], title, trade)
    end(outcome.errors, 0, 0)


def seeds_of(text: str) -> range:
    """Of the option --seeds.

    Raises:
        ValueError: It is no such range, or an empty one.
    """
    first, _, last = text.partition(":")
    if not (first.isdecimal() and last.isdecimal() and int(first) < int(last)):
        raise ValueError(f"--seeds: expected A:B with 0 <= A < B, got {text!r}")
    return range(int(first), int(last))


def setup_of(preset: Preset, settings: list[str] | None, frames: int, size: str) -> HomeSetup:
    """What all homes of a run have in common.

    Raises:
        ValueError: A setting is none, or the size.
    """
    from gslts.mapping.config import PRESETS
    from gslts_bench.homes import HomeSetup

    width, _, height = size.partition("x")
    sides = (width, height)
    if not all(side.isdecimal() and 16 <= int(side) <= 4096 for side in sides):
        raise ValueError(f"--size: expected WxH, each from 16 to 4096, got {size!r}")
    mapping = PRESETS[preset].with_settings(settings or [])
    return HomeSetup(frames=frames, width=int(width), height=int(height), mapping=mapping)


def prepare(work: Path, pictures: Path | None, *files: Path | None) -> None:
    """Finds out before hours of work whether what comes of them can be written.

    Args:
        work: Folder of recordings, maps and results; made.
        pictures: New or empty folder; made.
        files: To be written at the end.

    Raises:
        OSError: One cannot.
        ValueError: There is something in the folder of pictures.
    """
    from gslts.io.atomic_files import empty_folder

    for path in filter(None, files):
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir():
            raise IsADirectoryError(f"{path} is a folder")
        if not os.access(path.parent, os.W_OK):
            raise PermissionError(f"{path}: its folder cannot be written to")
    if pictures is not None:
        empty_folder(pictures)
    work.mkdir(parents=True, exist_ok=True)


def progress(what: str) -> tqdm[Any]:
    """A bar of seconds, whose total comes later."""
    from tqdm import tqdm

    return tqdm(total=1, desc=what, bar_format=BAR, smoothing=0.05, disable=None)


def write_json(path: Path | None, content: dict[str, Any]) -> None:
    """Writes everything that was found, if it is wanted.

    Raises:
        OSError: It cannot be written.
    """
    from gslts.io.atomic_files import write_atomic

    if path is not None:
        write_atomic(path, (json.dumps(content, indent=1) + "\n").encode())


def end(errors: dict[str, Any], missing: int, tasks: int) -> None:
    """Ends a benchmark.

    Raises:
        RuntimeError: Some of it failed.
    """
    for name, error in errors.items():
        typer.echo(f"{name}: {error}", err=True)
    if errors:
        raise RuntimeError(f"{len(errors)} tasks errored, named above")
    if missing:
        raise RuntimeError(f"the homes gave {tasks - missing} of {tasks} tasks")
