"""The command `gslts eval`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.arguments import Map
from gslts.cli.mapping import Dataset, Threads, echo_skipped

if TYPE_CHECKING:
    from gslts.core.gaussian_map import GaussianMap
    from gslts.mapping.evaluation.evaluate import HeldOutQuality
    from gslts.mapping.evaluation.rendering import RenderingQuality

# What a command needs is imported inside it, so that `gslts --help` answers at once.


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
    poses in the map. Of another recording, whose poses must be in the frame of the map, every 8th
    frame is a test frame.

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
    record = TrainingRecord.read(map_path, opened)
    if not record.cameras:
        typer.echo(f"{opened.name}: the map has no record of it; poses are as given", err=True)
    frames, skipped = read_test_frames(
        opened,
        record,
        every,
        lambda frames: tqdm(frames, desc="reading", unit="frame", disable=None),
    )
    echo_skipped(skipped)
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
