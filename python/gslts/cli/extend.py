"""The command `gslts extend`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.arguments import WritableMap
from gslts.cli.mapping import (
    BAR,
    Dataset,
    Poses,
    PosesOption,
    Preset,
    Threads,
    echo_skipped,
    open_with_poses,
)

if TYPE_CHECKING:
    from gslts.extension.pipeline import MapExtension

# Imports are inside the command, so that `gslts --help` starts fast.


def extend(
    map_path: WritableMap,
    dataset: Dataset,
    preset: Annotated[Preset, typer.Option(help="Speed against accuracy.")] = Preset.BALANCED,
    every: Annotated[
        int, typer.Option(min=1, help="Use every n-th frame, for long recordings.")
    ] = 1,
    poses: PosesOption = Poses.GIVEN,
    threads: Threads = 0,
) -> None:
    """Add what a recording shows and the map does not know, as a new version.

    Some frames must show a part of the map: all others are placed beside them by the poses of the
    recording, which may be in another world frame and may drift. What the map knows stays as it
    is; changes of it are left to gslts update. If the recording shows nothing new, the map stays as
    it is and the exit status is 0.

    Example: gslts extend out/map out/next_room
    """
    from tqdm import tqdm

    from gslts.extension.pipeline import extend_map
    from gslts.mapping.config import PRESETS
    from gslts.mapping.optimize import Progress

    opened = open_with_poses(dataset, poses, every, threads=threads)
    config = PRESETS[preset].with_settings([f"threads={threads}"])
    with (
        tqdm(desc="placing", unit="frame", disable=None) as placing,
        tqdm(total=100, desc="extending", bar_format=BAR, smoothing=0.05, disable=None) as bar,
    ):

        def report(progress: Progress) -> None:
            bar.set_postfix(psnr=f"{progress.psnr_db:.1f}", refresh=False)
            bar.update(100 * min(1.0, progress.share) - bar.n)

        result = extend_map(
            map_path,
            opened,
            config,
            show_frames=lambda frames: tqdm(frames, desc="reading", unit="frame", disable=None),
            on_placed=placing.update,
            report=report,
        )
    _echo(map_path, result)


def _echo(map_path: Path, result: MapExtension) -> None:
    """Print what was done, and what was not."""
    echo_skipped((*result.skipped, *result.placement.unplaced))
    if result.changed:
        typer.echo(
            f"{len(result.changed)} frames show changes of what the map knows, such as "
            f"{result.changed[0]}; gslts update publishes them",
            err=True,
        )
    placement, record = result.placement, result.record
    if record is None:
        typer.echo(f"{map_path} knows all that {len(placement.frames)} frames show: unchanged")
        return
    quality = "" if record.test_psnr_db is None else f"; test frames {record.test_psnr_db:.1f} dB"
    typer.echo(
        f"placed {record.placed} of {record.frames} frames, {len(placement.anchors)} of them by "
        f"the map; {record.new} show new space\n"
        f"version {result.version.number} of {map_path}: {record.added} Gaussians added, "
        f"{record.refined} refined at the seam, {sum(record.seconds.values()):.0f} s{quality}"
    )
