"""The commands `gslts bench`: quality and speed of the modules on many simulated homes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gslts.cli.evaluation import both_weights
from gslts.cli.jobs import progress_bar
from gslts.cli.mapping import Preset
from gslts_bench.cli.options import HomeOptions, finish, on_homes
from gslts_bench.cli.real import real
from gslts_bench.cli.ros import ros

# What a command needs is imported inside it, so that `gslts --help` answers at once.

bench = typer.Typer(no_args_is_help=True, help="Benchmarks on simulated homes and real rooms.")

Tasks = Annotated[int, typer.Option(min=1, help="Number of changes, spread over the homes.")]
Ablation = Annotated[
    bool, typer.Option("--ablation", help="Also measure the method with parts left out.")
]


@bench.callback()
def describe() -> None:
    """Benchmarks on simulated homes and real rooms."""


@bench.command()
@on_homes(preset=Preset.FAST)
def detect(
    options: HomeOptions,
    tasks: Tasks = 300,
    images: Annotated[
        Path | None, typer.Option(help="New or empty folder for overlays, right and wrong.")
    ] = None,
    trade: Annotated[
        Path | None, typer.Option(help="Also measure speed against accuracy; PNG of the plot.")
    ] = None,
) -> None:
    """Measure change detection: one, two and three changes, and none, seen once each.

    All detectors see the same frames; `watching` confirms changes over six of them. An interrupted
    run continues where it stopped.

    Example: gslts bench detect --jobs 2 --json out/detect.json --images out/detect
    """
    from gslts_bench.detection import overlays, run
    from gslts_bench.detection.plot import write_plot
    from gslts_bench.detection.tables import BENCHMARK

    units = run.units_of(options.homes(), tasks, trade=trade is not None)
    options.prepare(images, trade)
    outcome = options.run(BENCHMARK, units)
    errors = outcome.errors
    if trade is not None:
        title = f"Change detection: {tasks} tasks of {len(units)} home(s)"
        write_plot(outcome.summary["detectors"], title, trade)
    if images is not None:
        with progress_bar("drawing") as bar:
            errors |= overlays.draw(units, outcome.records, images, options.workers, bar)
    finish(errors, outcome.missing, tasks)


@bench.command()
@on_homes(seeds="0:3")
def update(
    options: HomeOptions,
    tasks: Tasks = 160,
    ablation: Ablation = False,
    curve: Annotated[
        Path | None, typer.Option(help="Also measure PSNR against iterations; PNG of the plot.")
    ] = None,
    curve_tasks: Annotated[int, typer.Option(min=1, help="Number of tasks with curves.")] = 18,
    images: Annotated[
        Path | None, typer.Option(help="New or empty folder for an image of each task.")
    ] = None,
    lpips_backbone: Annotated[
        Path | None, typer.Option(help="Weights of torchvision's AlexNet, for LPIPS.")
    ] = None,
    lpips_heads: Annotated[
        Path | None, typer.Option(help="alex.pth of the package lpips, for LPIPS.")
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads of an update.")] = 1,
    views: Annotated[int, typer.Option(min=3, help="Number of views around a changed region.")] = 9,
) -> None:
    """Measure updates: none, plain fine-tuning, editing as printed in GS-LTS, and ours.

    As in GS-LTS, changes that are not detected in the first frame are left out, and counted; test
    images are cropped to the change. An interrupted run continues where it stopped.

    Example: gslts bench update --jobs 2 --json out/update.json --images out/update
    """
    import shutil

    from gslts_bench.update.plot import write_plot
    from gslts_bench.update.run import units_of
    from gslts_bench.update.tables import BENCHMARK

    weights = both_weights(lpips_backbone, lpips_heads)
    drawn = 0 if curve is None else min(curve_tasks, tasks)
    units = units_of(
        options.homes(),
        tasks,
        views=views,
        ablation=ablation,
        curves=drawn,
        lpips=weights,
        threads=threads,
    )
    options.prepare(images, curve)
    outcome = options.run(BENCHMARK, units)
    if curve is not None:
        write_plot(outcome.summary["curves"], f"Updates of {drawn} tasks", curve)
    if images is not None:
        kinds = {record.task: record.kind for record in outcome.records}
        for task, kind in kinds.items():
            unit = next(unit for unit in units if task.startswith(f"{unit.name}/"))
            if (path := unit.image(task)).is_file():
                shutil.copyfile(path, images / f"{path.stem}_{kind}.png")
    finish(outcome.errors, outcome.missing, tasks)


@bench.command()
@on_homes()
def navigate(
    options: HomeOptions,
    episodes: Annotated[
        int, typer.Option(min=1, help="Number of episodes, spread over the homes.")
    ] = 300,
    moved: Annotated[
        int,
        typer.Option(
            min=0, help="Number of objects that move after mapping and are gone to as well."
        ),
    ] = 0,
    images: Annotated[
        Path | None, typer.Option(help="New or empty folder for the path of each episode.")
    ] = None,
) -> None:
    """Measure navigation to objects in mapped homes: success rate and SPL, as in SAVN.

    Semantic features come from the simulator's labels, which also judge success. An interrupted run
    continues where it stopped.

    Example: gslts bench navigate --moved 60 --jobs 2 --images out/navigate
    """
    from gslts_bench.navigation.relocated import units_of
    from gslts_bench.navigation.run import copy_images
    from gslts_bench.navigation.tables import BENCHMARK

    units = units_of(options.homes(), episodes, moved)
    options.prepare(images)
    outcome = options.run(BENCHMARK, units)
    if images is not None:
        copy_images(units, outcome.records, images)
    finish(outcome.errors)


@bench.command()
@on_homes(seeds="0:1")
def series(
    options: HomeOptions,
    changes: Annotated[int, typer.Option(min=1, help="Number of changes in each home.")] = 100,
    every: Annotated[int, typer.Option(min=1, help="Measure PSNR after so many changes.")] = 10,
    consolidate: Annotated[
        int, typer.Option(min=0, help="Consolidate the map after so many changes; 0 for never.")
    ] = 0,
    plot: Annotated[Path | None, typer.Option(help="PNG of PSNR and number of Gaussians.")] = None,
) -> None:
    """Measure many changes in a row: the updated map against one that is rebuilt at the end.

    Each change starts where the one before ended, and from the map that was made of it; what is not
    detected in the first frame stays as it is until it is seen again. With --consolidate, the robot
    takes more views of all changes every now and then.

    Example: gslts bench series --room kitchen --changes 100 --plot out/series.png
    """
    from gslts_bench.series.run import SeriesUnit
    from gslts_bench.series.tables import BENCHMARK, write_plot

    units = [SeriesUnit(home, changes, every, consolidate) for home in options.homes()]
    options.prepare(None, plot)
    outcome = options.run(BENCHMARK, units)
    if plot is not None:
        write_plot(outcome.summary, plot)
    finish(outcome.errors)


@bench.command()
@on_homes(preset=Preset.FAST)
def days(
    options: HomeOptions,
    changes: Annotated[int, typer.Option(min=1, help="Number of changes in each home.")] = 6,
) -> None:
    """Measure days of a robot that keeps its map: versions with something untrue, changes shown.

    Before each round, objects come, go or move. What the versions and the history of the map show
    is compared with what happened; names come from the simulator's labels. With 40 changes a home
    lives about 30 rounds. An interrupted run continues with the homes that are left.

    Example: gslts bench days --home bookstore.glb --seeds 0:10 --jobs 2 --json out/days.json
    """
    from gslts_bench.days.run import DaysUnit
    from gslts_bench.days.tables import BENCHMARK

    units = [DaysUnit(home, changes) for home in options.homes()]
    options.prepare()
    finish(options.run(BENCHMARK, units).errors)


@bench.command()
@on_homes()
def queries(
    options: HomeOptions,
    ablation: Ablation = False,
    trade: Annotated[
        Path | None,
        typer.Option(
            help="Also measure features of other lengths; PNG of accuracy, bytes and seconds."
        ),
    ] = None,
    detector: Annotated[
        bool,
        typer.Option(
            "--detector",
            help="Also measure boxes of a simulated detector: 30 % misses, 10 % false detections, "
            "10 % wrong names.",
        ),
    ] = False,
) -> None:
    """Measure queries: boxes of all objects of the twelve categories of GS-LTS, by name.

    In a foreign home, also of the types of its movable objects.

    Semantic features come from the simulator's labels. An interrupted run continues where it
    stopped.

    Example: gslts bench queries --jobs 2 --json out/queries.json --trade out/queries.png
    """
    from gslts_bench.queries.run import units_of
    from gslts_bench.queries.tables import BENCHMARK, write_plot

    units = units_of(options.homes(), trade=trade is not None, ablation=ablation, detector=detector)
    options.prepare(None, trade)
    outcome = options.run(BENCHMARK, units)
    if trade is not None:
        write_plot(outcome.summary, trade)
    finish(outcome.errors)


@bench.command()
@on_homes()
def extend(
    options: HomeOptions,
    parts: Annotated[
        int, typer.Option(min=2, max=10, help="Number of visits to a home of one room.")
    ] = 3,
) -> None:
    """Measure extensions: a map that grows visit by visit, against one map of all visits.

    A home of several rooms, such as a flat, is recorded room by room.

    Example: gslts bench extend --room flat --seeds 3:4 --frames 400 --json out/extend.json
    """
    from gslts_bench.extension.run import units_of
    from gslts_bench.extension.tables import BENCHMARK

    units = units_of(options.homes(), parts)
    options.prepare(None)
    finish(options.run(BENCHMARK, units).errors)


@bench.command()
@on_homes()
def relocalize(
    options: HomeOptions,
    views: Annotated[
        int,
        typer.Option(
            min=1,
            help="Number of frames of each home as mapped, after changes, and of other homes.",
        ),
    ] = 60,
    ablation: Ablation = False,
    trade: Annotated[
        Path | None,
        typer.Option(
            help="Also measure other resolutions, keypoints and iterations; PNG of a plot."
        ),
    ] = None,
    real: Annotated[
        Path | None,
        typer.Option(
            help="Instead of homes, a data set such as one of 7-Scenes: each eighth of its frames "
            "is localized in a map made without it."
        ),
    ] = None,
    fold: Annotated[
        list[int] | None,
        typer.Option(help="Of --real, one eighth instead of all, 0 to 7; may be repeated."),
    ] = None,
) -> None:
    """Measure relocalization: poses of frames in the map of their home, without a prior.

    Frames are taken of each home as it was mapped, after three changes, and of other homes, none of
    which may be found; in its own, the robot also tracks its pose from a start nearby. The
    simulator knows the true poses. An interrupted run continues where it stopped.

    Example: gslts bench relocalize --jobs 2 --json out/relocalize.json --trade out/relocalize.png
    """
    if real is not None:
        if ablation or trade is not None or options.home:
            raise ValueError("--ablation, --trade and --home are for homes, not for --real")
        _relocalize_room(options, real, fold or [])
        return
    from gslts_bench.relocalization.plot import write_plot
    from gslts_bench.relocalization.run import units_of
    from gslts_bench.relocalization.tables import BENCHMARK

    if fold:
        raise ValueError("--fold is for --real")
    units = units_of(options.homes(), views, ablation=ablation, trade=trade is not None)
    options.prepare(None, trade)
    outcome = options.run(BENCHMARK, units)
    if trade is not None:
        title = f"Relocalization: {views} frames of each of {len(units)} home(s)"
        write_plot(outcome.summary, title, trade)
    finish(outcome.errors)


def _relocalize_room(options: HomeOptions, path: Path, folds: list[int]) -> None:
    """Measure relocalization in a recorded room."""
    from gslts_bench.relocalization.fold import units_of
    from gslts_bench.relocalization.room import RecordedRoom
    from gslts_bench.relocalization.tables import ROOM_BENCHMARK

    units = units_of(RecordedRoom.of(path, options.setup.mapping, options.work), folds)
    options.prepare()
    outcome = options.run(ROOM_BENCHMARK, units, on_homes=False)
    finish(outcome.errors)


@bench.command()
@on_homes(seeds="3:4", preset=Preset.FAST, frames=80, size="320x240")
def scale(
    options: HomeOptions,
    gaussians: Annotated[
        list[int] | None,
        typer.Option(min=1, help="Size of a map; may be repeated. Default: 0.1, 1, 10 million."),
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="PNG of a plot of costs by size.")] = None,
) -> None:
    """Measure what a frame of one room costs in maps of more and more rooms.

    A mapped room is surrounded by copies of itself. Detection, localization, a query, an update and
    its commit should cost what they touch, whatever the size of the map. An interrupted run
    continues where it stopped.

    Example: gslts bench scale --room living_room --json out/scale.json --plot out/scale.png
    """
    from gslts_bench.scale.plot import write_plot
    from gslts_bench.scale.run import units_of
    from gslts_bench.scale.tables import BENCHMARK

    units = units_of(options.homes(), gaussians or [130_000, 1_200_000, 10_900_000])
    options.prepare(None, plot)
    outcome = options.run(BENCHMARK, units)
    if plot is not None:
        write_plot(outcome.summary, plot)
    finish(outcome.errors)


bench.command()(real)
bench.command()(ros)
