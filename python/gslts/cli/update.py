"""The command `gslts update`."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.arguments import WritableMap
from gslts.cli.localize import Localize, localizer_of, read_frames
from gslts.cli.mapping import BAR, Threads

if TYPE_CHECKING:
    from gslts.change.changes import Change
    from gslts.core.robot import Robot
    from gslts.localization.localizer import Localizer
    from gslts.store.causes import UpdateRecord
    from gslts.update import UpdateConfig
    from gslts.update.pipeline import MapUpdate

# Imports are inside the command, so that `gslts --help` starts fast.


class EditStrategy(StrEnum):
    """Pre-editing of the map."""

    OBJECTS = "objects"
    GS_LTS = "gs_lts"


def update(
    map_path: WritableMap,
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT",
            help="A simulated robot after the change, such as a task of gslts sim tasks.",
        ),
    ] = None,
    frames: Annotated[
        Path | None,
        typer.Option(metavar="DATASET", help="Recorded frames, taken after the change."),
    ] = None,
    needed: Annotated[
        int,
        typer.Option(
            min=1,
            max=6,
            help="Of --frames, number of six that must show a change; fewer for a recording with "
            "few views of each place.",
        ),
    ] = 3,
    iterations: Annotated[
        int, typer.Option(min=0, help="Maximum number of refinement steps.")
    ] = 250,
    localize: Localize = False,
    strategy: Annotated[
        EditStrategy,
        typer.Option(help="Editing of the map: ours, or that printed in GS-LTS."),
    ] = EditStrategy.OBJECTS,
    threads: Threads = 0,
) -> None:
    """Detect changes, collect views of them, and publish a new version of the map.

    Old versions stay in the history (gslts log). The folder of the map gets an image of the frames
    and of the map before and after. If nothing changed, the map stays as it is and the exit status
    is 0. An update that does not fit held-out views better is rejected: the exit status is 1, and
    gslts log names the reason.

    Example: gslts update out/map --robot out/tasks/0000_removal_Mug-1.json

    Example: gslts update out/map --frames out/visit --needed 1
    """
    from tqdm import tqdm

    from gslts.change.config import DetectionConfig
    from gslts.change.confirmation import MonitorConfig
    from gslts.change.constants import MIN_RECORDED_CONFIDENCE
    from gslts.robots.recorded import RecordedRobot
    from gslts.update import update_map

    if (robot is None) == (frames is None):
        raise ValueError("give either --robot or --frames")
    config = _config(iterations, strategy, threads)
    localizer = localizer_of(map_path, threads) if localize else None
    recorded = None if frames is None else list(read_frames(frames, localizer).values())
    scout = RecordedRobot(recorded) if recorded else open_robot_of(str(robot), localizer)

    with tqdm(total=0, desc="detecting", bar_format=BAR, disable=None) as bar:

        def report(changes: Sequence[Change]) -> None:
            for change in changes:
                tqdm.write(_describe_change(change))
            bar.total = config.refine.iterations + len(changes) * (config.collect.steps + 1)

        def advance(stage: str) -> None:
            bar.set_description(stage, refresh=False)
            bar.update()

        done = update_map(
            map_path,
            scout,
            config,
            detection=DetectionConfig(threads=threads),
            frames=recorded,
            monitor=MonitorConfig(needed=needed, confidence=MIN_RECORDED_CONFIDENCE),
            on_detected=report,
            progress=advance,
        )
    _echo_outcome(map_path, done)


def _echo_outcome(map_path: Path, done: MapUpdate) -> None:
    """Print what became of the map; raise RuntimeError if the update was rejected."""
    from gslts.store.manifest import update_image_path

    if done.status == "unchanged":
        typer.echo(f"{map_path} is unchanged: no change was detected")
        return
    if done.status == "rejected":
        raise RuntimeError(f"{map_path} is unchanged, the update was rejected: {done.reason}")
    assert done.result is not None
    for change, reason in done.result.rejected_changes:
        typer.echo(f"{change.kind} rejected: {reason}")
    typer.echo(_describe_record(done.result.record))
    version = done.version
    typer.echo(
        f"{map_path} is version {version.number} now: {version.gaussians} Gaussians; "
        f"see {update_image_path(map_path, version.number)}"
    )


def _config(iterations: int, strategy: EditStrategy, threads: int) -> UpdateConfig:
    from gslts.update import GS_LTS, EditConfig, RefineConfig, UpdateConfig

    return UpdateConfig(
        edit=GS_LTS if strategy == EditStrategy.GS_LTS else EditConfig(),
        refine=RefineConfig(iterations=iterations),
        threads=threads,
    )


def open_robot_of(name: str, localizer: Localizer | None) -> Robot:
    """Open a robot in its present surroundings.

    Args:
        name: Of the robot, as `gslts.robots.sources` knows it.
        localizer: Places it in the map by its frames; None uses its odometry.

    Raises:
        OSError: A file cannot be read.
        ValueError: Nobody knows the name.
    """
    from gslts.robots.localized import LocalizedRobot
    from gslts.robots.sources import open_robot

    source = open_robot(name)
    robot = source.robot(source.rounds or 0)
    return robot if localizer is None else LocalizedRobot(robot, localizer)


def _describe_change(change: Change) -> str:
    x, y, z = change.point
    return f"{change.kind} at ({x:.2f}, {y:.2f}, {z:.2f}) m, confidence {change.confidence:.2f}"


def _describe_record(record: UpdateRecord) -> str:
    seconds = ", ".join(f"{stage} {value:.1f} s" for stage, value in record.seconds.items())
    return (
        f"{record.training_views} training views, {record.validation_views} validation views, "
        f"{len(record.skipped)} frames skipped\n"
        f"{record.removed} Gaussians removed, {record.added} added, {record.refined} refined in "
        f"{record.iterations} steps\n"
        f"PSNR around the change in validation views: {record.psnr_before_db:.2f} dB before, "
        f"{record.psnr_after_db:.2f} dB after\n{seconds}"
    )
