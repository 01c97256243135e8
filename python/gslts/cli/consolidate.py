"""The command `gslts consolidate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.arguments import WritableMap
from gslts.cli.localize import Localize, localizer_of, read_frames
from gslts.cli.mapping import BAR, Threads
from gslts.cli.update import open_robot_of

if TYPE_CHECKING:
    from gslts.consolidation.pipeline import MapConsolidation

# Imports are inside the command, so that `gslts --help` starts fast.


def consolidate(
    map_path: WritableMap,
    robot: Annotated[
        str | None,
        typer.Option(metavar="ROBOT", help="A simulated robot, such as day.json of gslts sim day."),
    ] = None,
    frames: Annotated[
        Path | None,
        typer.Option(metavar="DATASET", help="Recorded frames of the home as it is now."),
    ] = None,
    localize: Localize = False,
    threads: Threads = 0,
) -> None:
    """Refine what updates have changed since the last consolidation, as a new version.

    For a robot that has time, such as at night: it takes up to 60 views from cameras of the map
    that see what changed, and the Gaussians there are fitted to them. All others stay as they are.
    If nothing changed, or held-out views do not fit better, the map stays as it is and the exit
    status is 0.

    Example: gslts consolidate out/map --robot out/day/day.json
    """
    from tqdm import tqdm

    from gslts.change.config import DetectionConfig
    from gslts.consolidation.constants import EPOCHS, MAX_VIEWS
    from gslts.consolidation.pipeline import consolidate_map
    from gslts.robots.recorded import RecordedRobot

    if (robot is None) == (frames is None):
        raise ValueError("give either --robot or --frames")
    localizer = localizer_of(map_path, threads) if localize else None
    if frames is None:
        scout = open_robot_of(str(robot), localizer)
    else:
        scout = RecordedRobot(list(read_frames(frames, localizer).values()))
    total = MAX_VIEWS * (1 + EPOCHS)
    with tqdm(total=total, desc="collecting", bar_format=BAR, disable=None) as bar:

        def advance(stage: str) -> None:
            bar.set_description(stage, refresh=False)
            bar.update()

        done = consolidate_map(
            map_path,
            scout,
            detection=DetectionConfig(threads=threads),
            threads=threads,
            progress=advance,
        )
    _echo(map_path, done)


def _echo(map_path: Path, done: MapConsolidation) -> None:
    """Print what was done."""
    for reason in done.skipped:
        typer.echo(f"skipped: {reason}", err=True)
    record = done.record
    if record is None:
        typer.echo(f"{map_path} is unchanged: {done.reason}")
        return
    quality = ""
    if record.psnr_before_db is not None and record.psnr_after_db is not None:
        quality = (
            f"; around the changes, test views have {record.psnr_after_db:.2f} dB instead of "
            f"{record.psnr_before_db:.2f}"
        )
    typer.echo(
        f"version {done.version.number} of {map_path}: {record.refined} Gaussians refined by "
        f"{record.views} views, {sum(record.seconds.values()):.0f} s{quality}"
    )
