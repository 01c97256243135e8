"""The commands `gslts map` and `gslts eval`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.arguments import Map

if TYPE_CHECKING:
    from gslts.core.gaussian_map import GaussianMap
    from gslts.datasets import Dataset as OpenedDataset
    from gslts.mapping.checkpoint import Checkpoint
    from gslts.mapping.config import MappingConfig
    from gslts.mapping.engine import MappingResult
    from gslts.mapping.evaluation.evaluate import HeldOutQuality
    from gslts.mapping.evaluation.rendering import RenderingQuality

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


PosesOption = Annotated[
    Poses,
    typer.Option(
        help="Poses of the frames: as the recording gives them, these corrected by loop closures, "
        "or estimated from the images alone."
    ),
]
Dataset = Annotated[
    Path,
    typer.Argument(
        help="Folder in the layout of nerfstudio, 7-Scenes, TUM RGB-D or COLMAP, or a ROS 2 bag."
    ),
]
BAR = "{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining}{postfix}"
"""Format of progress bars: stage, share, time passed and time left."""
CHECKPOINT, TRAJECTORY, COLMAP = ".checkpoint.npz", ".trajectory.json", ".colmap"
"""Endings of what a run keeps beside the folder of the map: its state, estimated poses, and the
data set of photographs."""
Threads = Annotated[int, typer.Option(min=0, help="Number of threads; 0: all hardware threads.")]


def make(
    dataset: Dataset,
    out: Annotated[Path, typer.Option(help="New folder of the map.")],
    preset: Annotated[Preset, typer.Option(help="Speed against accuracy.")] = Preset.BALANCED,
    iterations: Annotated[
        int | None, typer.Option(min=1, help="Optimisation steps. Default: those of the preset.")
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
        bool, typer.Option("--resume", help="Continue an interrupted run from its checkpoint.")
    ] = False,
    threads: Threads = 0,
) -> None:
    """Make a map of posed RGB-D frames.

    Every 8th frame is held out from training: alternately a test frame, on which quality is
    reported, and a validation frame, which ends the optimization.

    A warning tells if the map does not show the frames that it was made from.

    The folder of the map holds the Gaussians, a manifest, the corrected cameras and report.html.
    During the run, OUT.checkpoint.npz and OUT.trajectory.json hold the state for --resume.

    With --poses correct or estimate, frames that cannot be placed are named and left out. With
    estimate, DATASET may also be a folder of photographs; OUT.colmap gets their poses.

    Example: gslts map out/kitchen_3 --out out/map

    Example: gslts map recording --poses estimate --out out/map
    """
    from gslts.mapping.checkpoint import read_checkpoint
    from gslts.mapping.config import PRESETS
    from gslts.mapping.report.summary import summary_of, warning_of, write_result

    if out.exists():
        raise FileExistsError(f"{out} is there already")
    saved, trajectory, colmap = (_beside(out, e) for e in (CHECKPOINT, TRAJECTORY, COLMAP))
    if saved.exists() and not resume:
        raise FileExistsError(
            f"{saved}: an interrupted run; continue it with --resume, or remove the file"
        )
    if colmap.exists() and not resume:
        raise FileExistsError(f"{colmap} is there already; map this data set, or remove it")
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
    start = read_checkpoint(saved) if resume else None
    opened = open_with_poses(dataset, poses, every, out)
    out.parent.mkdir(parents=True, exist_ok=True)
    result = _map_with_bar(opened, config, start, saved)
    write_result(out, result, opened.name, None if poses is Poses.GIVEN else opened)
    saved.unlink(missing_ok=True)
    trajectory.unlink(missing_ok=True)
    for reason in result.skipped:
        typer.echo(f"skipped {reason}", err=True)
    if (warning := warning_of(result)) is not None:
        typer.echo(f"warning: {warning}", err=True)
    typer.echo(f"wrote {out}: {summary_of(result)}")


def _beside(out: Path, ending: str) -> Path:
    """Return the path of a file of the run that makes a map."""
    return out.with_name(out.name + ending)


def open_with_poses(
    dataset: Path, poses: Poses, every: int = 1, out: Path | None = None
) -> OpenedDataset:
    """Open a data set at given, corrected or estimated poses, with progress bars.

    Args:
        dataset: Folder or file.
        poses: Source of the poses.
        every: Use every n-th frame.
        out: Folder of the map that is made. Poses that were found are kept beside it, and read
            from there if they were found before. None if they serve another map.

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

    if is_photographs(dataset):
        if poses is not Poses.ESTIMATE:
            raise ValueError(f"{dataset}: photographs without poses; --poses estimate finds them")
        return _open_photographs(dataset, every, out)
    if poses is Poses.GIVEN:
        opened = open_dataset(dataset)
        return replace(opened, frames=opened.frames[::every])
    opened = open_dataset(dataset, posed=False)
    opened = replace(opened, frames=opened.frames[::every])
    saved = None if out is None else _beside(out, TRAJECTORY)
    if saved is not None and saved.exists():
        return with_poses(opened, read_trajectory(saved))
    found = estimate_poses(
        opened,
        correct=poses is Poses.CORRECT,
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
    colmap = _beside(out, COLMAP)
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


def judge(
    map_path: Map,
    dataset: Dataset,
    every: Annotated[
        int | None,
        typer.Option(min=1, help="Use every n-th frame instead of the test frames."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    threads: Threads = 0,
    lpips_backbone: Annotated[
        Path | None, typer.Option(help="Weights of torchvision's AlexNet, for LPIPS.")
    ] = None,
    lpips_heads: Annotated[
        Path | None, typer.Option(help="alex.pth of the package lpips, for LPIPS.")
    ] = None,
) -> None:
    """Evaluate a map on its test frames: frames that neither trained nor validated it.

    Figures are given for poses of the data set, for poses corrected by those of neighbouring
    training frames, and for poses refined against the map; the exposure of each frame is fitted.
    Frames that cannot be used are skipped. A recording that extended the map is evaluated at its
    poses in the map.

    Example: gslts eval out/map out/kitchen_3
    """
    from tqdm import tqdm

    from gslts.mapping.evaluation.evaluate import evaluate_held_out
    from gslts.mapping.evaluation.held_out import TrainingRecord, read_test_frames
    from gslts.mapping.evaluation.rendering import evaluate_rendering
    from gslts.rendering.metrics import Lpips
    from gslts.store.map_folder import read_map
    from gslts.store.trajectory_file import open_recording

    weights = both_weights(lpips_backbone, lpips_heads)
    lpips = None if weights is None else Lpips(*weights)
    gaussian_map = read_map(map_path)
    opened = open_recording(map_path, dataset)
    frames, skipped = read_test_frames(
        opened,
        TrainingRecord.read(map_path, opened.name),
        every,
        lambda frames: tqdm(frames, desc="reading", unit="frame", disable=None),
    )
    for reason in skipped:
        typer.echo(f"skipped {reason}", err=True)
    quality, _ = evaluate_held_out(gaussian_map, frames, threads)
    rgbd = [frame.rgbd() for frame in frames.observations.values()]
    rest = evaluate_rendering(gaussian_map, rgbd, lpips, threads)
    if as_json:
        typer.echo(_quality_json(gaussian_map, quality, rest, skipped))
    else:
        _echo_quality(gaussian_map, quality, rest)


def _quality_json(
    gaussian_map: GaussianMap,
    quality: HeldOutQuality,
    rest: RenderingQuality,
    skipped: Sequence[str],
) -> str:
    from dataclasses import asdict

    sizes = {
        "gaussians": gaussian_map.size,
        "bytes": gaussian_map.nbytes,
        "bytes_per_gaussian": gaussian_map.nbytes / max(1, gaussian_map.size),
    }
    return json.dumps({**asdict(quality), **asdict(rest), **sizes, "skipped": skipped})


def _echo_quality(
    gaussian_map: GaussianMap, quality: HeldOutQuality, rest: RenderingQuality
) -> None:
    from dataclasses import asdict

    for name, figures in asdict(quality).items():
        if figures is not None:
            depth_m = figures["depth_l1_m"]
            depth = "" if depth_m is None else f", depth error {100 * depth_m:.2f} cm"
            typer.echo(
                f"{figures['frames']} frames, poses {name.replace('_', ' ')}: "
                f"{figures['psnr_db']:.2f} dB, SSIM {figures['ssim']:.3f}{depth}"
            )
    per_gaussian = gaussian_map.nbytes / max(1, gaussian_map.size)
    typer.echo(
        f"{gaussian_map.size} Gaussians in {gaussian_map.nbytes} bytes, {per_gaussian:.1f} each; "
        f"{rest.render_ms:.1f} ms a rendering"
    )
    typer.echo(
        "no LPIPS: it needs weights, --lpips-backbone and --lpips-heads"
        if rest.lpips is None
        else f"LPIPS {rest.lpips:.4f}"
    )


def both_weights(backbone: Path | None, heads: Path | None) -> tuple[Path, Path] | None:
    """Check that the files of `gslts.rendering.metrics.Lpips` are both given, or neither.

    Args:
        backbone: Weights of AlexNet.
        heads: Weights of LPIPS.

    Returns:
        Both files; None without them.

    Raises:
        ValueError: Only one is given.
    """
    if backbone is None and heads is None:
        return None
    if backbone is None or heads is None:
        raise ValueError("LPIPS needs both --lpips-backbone and --lpips-heads")
    return backbone, heads
