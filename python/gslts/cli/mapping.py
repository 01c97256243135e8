"""The command `gslts map`."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.jobs import NumberOfJobs, Scheduler, workers_of

if TYPE_CHECKING:
    from gslts.datasets import Dataset as OpenedDataset
    from gslts.mapping.checkpoint import Checkpoint
    from gslts.mapping.config import MappingConfig
    from gslts.mapping.engine import MappingResult

# Commands import what they need inside, so that `gslts --help` is fast.


class Preset(StrEnum):
    """Presets of the mapping engine, from fast to accurate: `gslts.mapping.config.PRESETS`."""

    FAST = "fast"
    BALANCED = "balanced"
    BEST = "best"


class Poses(StrEnum):
    """Source of the poses of a recording."""

    GIVEN = "given"
    CORRECT = "correct"
    ESTIMATE = "estimate"
    UPRIGHT = "upright"


PosesOption = Annotated[
    Poses,
    typer.Option(
        help="Poses of the frames: as the recording gives them, these corrected by loop closures, "
        "estimated from the images alone, or as given, but turned so that z is up."
    ),
]
LAYOUTS = "nerfstudio, 7-Scenes, TUM RGB-D, COLMAP, Record3D, Polycam, RTAB-Map, ScanNet or Replica"
"""Layouts of recordings that all commands read, besides ROS 2 bags."""
Dataset = Annotated[
    Path, typer.Argument(help=f"A ROS 2 bag, or a recording in the layout of {LAYOUTS}.")
]
BAR = "{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining}{postfix}"
"""Format of progress bars: stage, share, time passed and time left."""
CHECKPOINT, TRAJECTORY, COLMAP = ".checkpoint.npz", ".trajectory.json", ".colmap"
"""Endings of what a run keeps beside the folder of the map: its state, estimated poses, and the
data set of photographs."""
Threads = Annotated[int, typer.Option(min=0, help="Number of threads; 0: all hardware threads.")]


def make(
    datasets: Annotated[
        list[Path],
        typer.Argument(
            metavar="DATASET...",
            help=f"ROS 2 bags, or recordings in the layout of {LAYOUTS}.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(help="New folder of the map; of several data sets, folder of their maps."),
    ],
    preset: Annotated[Preset, typer.Option(help="Speed against accuracy.")] = Preset.BALANCED,
    iterations: Annotated[
        int | None, typer.Option(min=1, help="Optimization steps. Default: those of the preset.")
    ] = None,
    budget_s: Annotated[
        float | None,
        typer.Option(
            min=1,
            help="Time for reading and optimization, s, instead of --iterations; the evaluation "
            "comes after it.",
        ),
    ] = None,
    max_gaussians: Annotated[
        int | None, typer.Option(min=1, help="Maximum number of Gaussians.")
    ] = None,
    every: Annotated[
        int, typer.Option(min=1, help="Use every n-th frame, for long recordings.")
    ] = 1,
    poses: PosesOption = Poses.GIVEN,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Value of a setting of `gslts.mapping.config`; may be repeated.",
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue an interrupted run from what it kept.")
    ] = False,
    threads: Threads = 0,
    jobs: NumberOfJobs = None,
    scheduler: Scheduler = None,
) -> None:
    """Make a map of posed RGB-D frames.

    Every 8th frame is held out from training: alternately a test frame, on which quality is
    reported, and a validation frame, which ends the optimization.

    A warning tells if the map does not show the frames that it was made from.

    The folder of the map holds the Gaussians, a manifest, the corrected cameras and report.html.
    During the run, OUT.checkpoint.npz and OUT.trajectory.json hold the state for --resume.

    With --poses correct or estimate, frames that cannot be placed are named and left out. With
    estimate, DATASET may also be a folder of photographs; OUT.colmap gets their poses. A map of
    upright poses has a world of its own: later frames need --localize.

    Each of several data sets gets a map in OUT, in a folder of its name; with --jobs and
    --scheduler, they are made at the same time, on one thread each unless --threads says more. The
    same command continues an interrupted run.

    Example: gslts map out/kitchen_3 --out out/map

    Example: gslts map recording --poses estimate --out out/map

    Example: gslts map monday tuesday --out out/maps --scheduler local
    """
    if len(datasets) > 1 or jobs is not None or scheduler is not None:
        from gslts.cli.map_jobs import make_maps

        options = {
            "preset": preset,
            "iterations": iterations,
            "budget_s": budget_s,
            "max_gaussians": max_gaussians,
            "every": every,
            "poses": poses,
            "settings": settings,
            "threads": threads or 1,
        }
        make_maps(datasets, out, options, workers_of(jobs, scheduler))
        return
    (dataset,) = datasets
    from gslts.mapping.checkpoint import read_checkpoint
    from gslts.mapping.config import PRESETS
    from gslts.mapping.report.summary import summary_of, warning_of, write_result
    from gslts.trajectory.upright import describe_tilt

    if out.exists():
        raise FileExistsError(f"{out} is there already")
    saved, trajectory, colmap = (beside(out, e) for e in (CHECKPOINT, TRAJECTORY, COLMAP))
    if saved.exists() and not resume:
        raise FileExistsError(
            f"{saved}: an interrupted run; continue it with --resume, or remove the file"
        )
    if colmap.exists() and not resume:
        raise FileExistsError(f"{colmap} is there already; use it with --resume, or remove it")
    if resume and not is_interrupted(out):
        raise FileNotFoundError(f"{saved} is missing: there is no interrupted run to continue")
    if not resume:
        trajectory.unlink(missing_ok=True)
    options = {
        "iterations": iterations,
        "budget_s": budget_s,
        "max_gaussians": max_gaussians,
        "threads": threads,
    }
    chosen = [f"{name}={value}" for name, value in options.items() if value is not None]
    config = PRESETS[preset].with_settings([*chosen, *(settings or [])])
    start = read_checkpoint(saved) if saved.exists() else None
    opened = open_with_poses(dataset, poses, every, out, threads)
    if tilt := describe_tilt([frame.camera for frame in opened.frames]):
        typer.echo(
            f"warning: {opened.name}: {tilt}; navigation needs z up: --poses upright turns it",
            err=True,
        )
    out.parent.mkdir(parents=True, exist_ok=True)
    result = _map_with_bar(opened, config, start, saved)
    write_result(out, result, opened.name, None if poses is Poses.GIVEN else opened)
    saved.unlink(missing_ok=True)
    trajectory.unlink(missing_ok=True)
    echo_skipped(result.skipped)
    if (warning := warning_of(result)) is not None:
        typer.echo(f"warning: {warning}", err=True)
    typer.echo(f"wrote {out}: {summary_of(result)}")


def beside(out: Path, ending: str) -> Path:
    """Return the path of a file of the run that makes a map.

    Args:
        out: Folder of the map.
        ending: Ending of the file, such as `CHECKPOINT`.
    """
    return out.with_name(out.name + ending)


def is_interrupted(out: Path) -> bool:
    """Return True if a run that was to make a map kept its state or poses.

    Args:
        out: Folder of the map, which does not exist.
    """
    return any(beside(out, ending).exists() for ending in (CHECKPOINT, TRAJECTORY, COLMAP))


def echo_skipped(left_out: Iterable[str]) -> None:
    """Print which frames are left out and why, with one line for each reason.

    Args:
        left_out: Lines of the form "name: reason".
    """
    from gslts.datasets.dataset import join_reasons

    for line in join_reasons(left_out):
        typer.echo(f"skipped {line}", err=True)


def open_with_poses(
    dataset: Path, poses: Poses, every: int = 1, out: Path | None = None, threads: int = 0
) -> OpenedDataset:
    """Open a data set at given, corrected, estimated or turned poses, with progress bars.

    Args:
        dataset: Folder or file.
        poses: Source of the poses.
        every: Use every n-th frame.
        out: Folder of the map that is made. Poses that were found are kept beside it, and read
            from there if they were found before. None if they serve another map.
        threads: Number of threads; 0 uses all hardware threads.

    Raises:
        OSError: The path does not exist or cannot be read.
        ValueError: It is no data set, or no pose can be estimated.
    """
    from dataclasses import replace

    from tqdm import tqdm

    from gslts.datasets import open_dataset
    from gslts.datasets.posed import with_poses
    from gslts.store.trajectory_file import read_trajectory, write_trajectory
    from gslts.trajectory.estimate import estimate_poses
    from gslts.trajectory.photographs import is_photographs
    from gslts.trajectory.upright import turn_upright

    if is_photographs(dataset):
        if poses is not Poses.ESTIMATE:
            raise ValueError(f"{dataset}: photographs without poses; --poses estimate finds them")
        return _open_photographs(dataset, every, out)
    if poses in (Poses.GIVEN, Poses.UPRIGHT):
        opened = open_dataset(dataset)
        opened = replace(opened, frames=opened.frames[::every])
        return opened if poses is Poses.GIVEN else turn_upright(opened)
    opened = open_dataset(dataset, posed=False)
    opened = replace(opened, frames=opened.frames[::every])
    saved = None if out is None else beside(out, TRAJECTORY)
    if saved is not None and saved.exists():
        return with_poses(opened, read_trajectory(saved))
    found = estimate_poses(
        opened,
        correct=poses is Poses.CORRECT,
        threads=threads,
        show_frames=lambda frames: tqdm(frames, desc="odometry", unit="frame", disable=None),
        show_loops=lambda loops: tqdm(loops, desc="loop closures", unit="pair", disable=None),
    )
    for reason in found.unplaced:
        typer.echo(f"not placed: {reason}", err=True)
    typer.echo(
        f"placed {len(found.dataset.frames)} of {len(opened.frames)} frames: {found.keyframes} "
        f"keyframes, {found.loops} loop closures",
        err=True,
    )
    if saved is not None:
        saved.parent.mkdir(parents=True, exist_ok=True)
        write_trajectory(saved, found.dataset)
    return found.dataset


def _open_photographs(folder: Path, every: int, out: Path | None) -> OpenedDataset:
    """Estimate the poses of photographs, and keep them in a data set beside the map."""
    from tqdm import tqdm

    from gslts.datasets import open_dataset
    from gslts.trajectory.photographs import place_photographs

    if out is None:
        raise ValueError(f"{folder}: photographs do not tell the scale of the map")
    colmap = beside(out, COLMAP)
    if colmap.exists():
        return open_dataset(colmap)
    with tqdm(total=4, bar_format=BAR, disable=None) as bar:

        def report(stage: str) -> None:
            bar.set_description(stage)
            bar.update()

        placed = place_photographs(folder, colmap, every, report)
    for reason in placed.unplaced:
        typer.echo(f"not placed: {reason}", err=True)
    typer.echo(
        f"placed {len(placed.dataset.frames)} photographs; {colmap} is a data set with their "
        "poses. Their scale is a guess",
        err=True,
    )
    return placed.dataset


def _map_with_bar(
    opened: OpenedDataset, config: MappingConfig, start: Checkpoint | None, saved: Path
) -> MappingResult:
    """Make a map with a progress bar, and save checkpoints."""
    from tqdm import tqdm

    from gslts.mapping.checkpoint import write_checkpoint
    from gslts.mapping.engine import make_map
    from gslts.mapping.optimize import Progress

    with tqdm(total=100, desc="mapping", bar_format=BAR, smoothing=0.05, disable=None) as bar:

        def report(progress: Progress) -> None:
            bar.set_postfix(
                step=progress.iteration,
                loss=f"{progress.loss:.3f}",
                psnr=f"{progress.psnr_db:.1f}",
                gaussians=progress.gaussians,
                refresh=False,
            )
            bar.update(100 * min(1.0, progress.share) - bar.n)

        return make_map(
            opened,
            config,
            resume=start,
            save=lambda checkpoint: write_checkpoint(saved, checkpoint),
            show_frames=lambda frames: tqdm(frames, desc="reading", unit="frame", disable=None),
            report=report,
        )
