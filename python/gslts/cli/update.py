"""The command `gslts update`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.locate import Locate, localizer_of, read_frames
from gslts.cli.mapping import BAR, Map, Threads

if TYPE_CHECKING:
    from gslts.change.changes import Change
    from gslts.change.detector import ChangeDetector
    from gslts.core.robot import Robot
    from gslts.localization.localizer import Localizer
    from gslts.store.causes import UpdateRecord

# What a command needs is imported inside it, so that `gslts --help` answers at once.


def update(
    map_path: Map,
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT",
            help="A simulated robot after the change: a scene change task of gslts sim tasks.",
        ),
    ] = None,
    frames: Annotated[
        Path | None,
        typer.Option(metavar="DATASET", help="Recorded frames, taken after the change."),
    ] = None,
    iterations: Annotated[int, typer.Option(min=0, help="Of the refinement, at most.")] = 250,
    locate: Locate = False,
    literal: Annotated[
        bool, typer.Option("--literal", help="Edit as printed in GS-LTS, without improvements.")
    ] = False,
    threads: Threads = 0,
) -> None:
    """Look closer at what changed, edit the map there, and refine only that.

    The map gets a new version; what was before stays in its past (gslts log). A picture of what was
    seen, and of the map before and after, lies in the folder of the map. An update that does not
    fit views kept aside better is rejected: there is no new version then, and gslts log tells why.

    Example: gslts update out/map --robot out/tasks/0000_removal_Mug-1.json
    """
    from tqdm import tqdm

    from gslts.change.config import DetectionConfig
    from gslts.change.detector import ChangeDetector
    from gslts.robots.localized import LocalizedRobot
    from gslts.robots.sources import open_robot
    from gslts.semantics.map_semantics import MapSemantics
    from gslts.store.camera_files import cameras_of_map
    from gslts.store.causes import RejectedUpdateCause, UpdateRecord
    from gslts.store.manifest import update_image_path
    from gslts.store.map_folder import open_map
    from gslts.update.config import GS_LTS, UpdateConfig
    from gslts.update.publish import published
    from gslts.update.updater import update as run

    if (robot is None) == (frames is None):
        raise ValueError("give either --robot or --frames")
    config = UpdateConfig(threads=threads)
    refine = config.refine.model_copy(update={"iterations": iterations})
    config = config.model_copy(update={"refine": refine})
    if literal:
        config = config.model_copy(update={"edit": GS_LTS})
    with open_map(map_path, writable=True) as store:
        before, gaussian_map = store.version(), store.read()
        cameras, semantics = cameras_of_map(map_path), MapSemantics.of_map(map_path, threads)
        detector = ChangeDetector(
            gaussian_map, DetectionConfig(threads=threads), cameras=cameras.values()
        )
        localizer = localizer_of(map_path, threads) if locate else None
        if robot is not None:
            source = open_robot(robot)
            scout = source.robot(source.rounds or 0)
            if localizer is not None:
                scout = LocalizedRobot(scout, localizer)
            detection = detector.detect(scout.observe())
            changes, fault = list(detection.changes), detection.unreliable
        else:
            assert frames is not None  # One of them is given.
            scout, changes, fault = _recorded(frames, detector, localizer)
        if not changes:
            why = fault or "nothing changed"
            store.add_rejection(RejectedUpdateCause(record=UpdateRecord(rejected=why)))
            raise RuntimeError(f"{map_path} stays as it is: {why}")
        for change in changes:
            x, y, z = change.point
            typer.echo(f"{change.kind} at ({x:.2f}, {y:.2f}, {z:.2f}) m, {change.confidence:.2f}")
        steps = config.refine.iterations + len(changes) * (config.collect.steps + 1)
        with tqdm(total=steps, desc="updating", bar_format=BAR, disable=None) as bar:

            def tell(stage: str) -> None:
                bar.set_description(stage, refresh=False)
                bar.update()

            result = run(
                gaussian_map,
                list(cameras.values()),
                changes,
                scout,
                config,
                detector=detector,
                first_id=before.next_id,
                semantics=semantics,
                tell=tell,
            )
        version = published(
            store, gaussian_map, cameras.values(), result, config, semantics=semantics
        )
    if version is None:
        raise RuntimeError(f"{map_path} stays as it is: {result.record.rejected}")
    for change, why in result.left:
        typer.echo(f"{change.kind} left as it was: {why}")
    typer.echo(_words(result.record, gaussian_map.size))
    picture = update_image_path(map_path, version.number)
    typer.echo(
        f"{map_path} is version {version.number} now: {version.gaussians} Gaussians; see {picture}"
    )


def _recorded(
    path: Path, detector: ChangeDetector, localizer: Localizer | None
) -> tuple[Robot, list[Change], str | None]:
    """A robot that replays frames, the changes that enough of them show, or why they show none."""
    from gslts.change.monitor import confirm_changes
    from gslts.robots.recorded import RecordedRobot

    frames = list(read_frames(path, localizer).values())
    changes, counts = confirm_changes(detector, frames)
    fault = None
    if counts.unreliable == counts.processed:
        fault = f"none of {counts.processed} frames can be compared with it; gslts detect tells why"
    return RecordedRobot(frames), changes, fault


def _words(record: UpdateRecord, size: int) -> str:
    used, held_back = record.training_views, record.validation_views
    seconds = ", ".join(f"{name} {value:.1f} s" for name, value in record.seconds.items())
    return (
        f"{used} views used, {held_back} held back, {len(record.skipped)} skipped\n"
        f"of {size} Gaussians {record.removed} removed and {record.refined} refined in "
        f"{record.iterations} steps; {record.added} are new\n"
        f"views held back, around the change: {record.psnr_before_db:.2f} dB before, "
        f"{record.psnr_after_db:.2f} dB after\n{seconds}"
    )
