"""Consolidation of a map in memory: collect views of past changes, refine, verify.

Updates are made from about nine views each, while the robot goes about its work. A robot that has
time, such as at night, takes views from all training cameras that see what changed, of all changes
at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gslts.change.confirmation import (
    ChangeConfirmation,
    MonitorConfig,
    Report,
    latest_reports,
)
from gslts.change.detector import ChangeDetector
from gslts.change.visibility import Visibility
from gslts.consolidation.constants import (
    MAX_CORRECTION_M,
    MAX_UNKNOWN_CHANGES,
    MAX_VIEWS,
    MIN_CHANGE_VIEWS,
    MIN_GAIN_DB,
)
from gslts.consolidation.fit import Fit, refine_regions, region_psnr_db
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot
from gslts.extension.fit import without_changes
from gslts.extension.grow import compare_frames
from gslts.mapping.clock import Clock
from gslts.mapping.evaluation.evaluate import refine_pose
from gslts.mapping.frames import MIN_FRAMES_TO_HOLD_OUT, FrameSplit, split_held_out
from gslts.mapping.observation import Observation
from gslts.robots.driving import go_to, short_path
from gslts.store.causes import ConsolidationRecord
from gslts.store.delta import Delta, compare_by_ids
from gslts.update.region import Region
from gslts.update.targets import spread_cameras

Progress = Callable[[Literal["collecting", "refining"]], None]
"""Called after each step of a stage that takes long."""


@dataclass(frozen=True, eq=False)
class Consolidation:
    """Result of a consolidation.

    Attributes:
        delta: Changes from the map before; None if it was rejected.
        record: Counts, times and quality; None if it was rejected.
        cameras: Cameras of the training views.
        rejected: Reason for leaving the map unchanged; None if it was accepted.
        skipped: Reasons for skipping views.
    """

    delta: Delta | None
    record: ConsolidationRecord | None
    cameras: tuple[Camera, ...]
    rejected: str | None
    skipped: tuple[str, ...]


def consolidate(
    gaussian_map: GaussianMap,
    cameras: Sequence[Camera],
    regions: Sequence[Region],
    robot: Robot,
    *,
    detector: ChangeDetector | None = None,
    threads: int = 0,
    progress: Progress = lambda _: None,
) -> Consolidation:
    """Refine the Gaussians around past changes by new views; all others stay bit-identical.

    Pixels that show another state of the home than the map are left out, and so are views that the
    detector cannot compare with it. The result is rejected if held-out views do not fit better.

    Args:
        gaussian_map: float32.
        cameras: Training cameras of the map; the robot takes views from those that see a change.
        regions: Boxes of the changes.
        robot: In the home.
        detector: Of the map; finds views of another place. None means one with default settings.
        threads: 0 uses all hardware threads.
        progress: Called after each view and after each step of the refinement.

    Raises:
        ValueError: Too few views show a change, or the home differs from its map.
    """
    detector = detector or ChangeDetector(gaussian_map, cameras=cameras)
    clock = Clock(None, {})
    frames = _collect(robot, spread_cameras(cameras, regions, MAX_VIEWS), progress)
    clock.note("collecting")
    placed, skipped, changes = _place(frames, detector, threads)
    if len(placed) < MIN_FRAMES_TO_HOLD_OUT:
        why = f"; {skipped[-1]}" if skipped else ""
        raise ValueError(
            f"{len(placed)} usable views show what changed, {MIN_FRAMES_TO_HOLD_OUT} are needed: "
            f"let the robot reach more positions around it, or record more frames{why}"
        )
    if changes > MAX_UNKNOWN_CHANGES:
        raise ValueError(
            f"the views show {changes} changes that the map does not: run a round first "
            "(gslts run), then consolidate"
        )
    visibility = Visibility(gaussian_map, cameras, threads)
    spaces = compare_frames(gaussian_map, visibility, placed, threads)
    views = {name: without_changes(frame, spaces[name]) for name, frame in placed.items()}
    split = FrameSplit.of(views, split_held_out)
    clock.note("comparing")
    training = list(split.training.values())
    fit = refine_regions(gaussian_map, training, regions, threads, lambda _: progress("refining"))
    clock.note("refining")
    used = tuple(frame.camera() for frame in training)
    rejected = _no_better(fit, split, regions, threads)
    if rejected is not None:
        return Consolidation(None, None, used, rejected, skipped)
    record = ConsolidationRecord(
        views=len(training),
        held_out=len(split.held_out),
        refined=fit.refined,
        removed=fit.before.size - fit.after.size,
        iterations=fit.iterations,
        psnr_before_db=region_psnr_db(fit.before, split.test, regions, threads),
        psnr_after_db=region_psnr_db(fit.after, split.test, regions, threads),
        seconds=clock.with_current("verifying"),
    )
    return Consolidation(compare_by_ids(fit.before, fit.after), record, used, None, skipped)


def _collect(robot: Robot, cameras: Sequence[Camera], progress: Progress) -> list[RgbdFrame]:
    """Take a frame from each camera that the robot reaches, on a short path."""
    frames: list[RgbdFrame] = []
    poses = np.array([camera.world_from_camera for camera in cameras]).reshape(-1, 4, 4)
    for row in short_path(poses, robot.pose()):
        if go_to(robot, cameras[row]):
            frame = robot.observe()
            if all(frame is not other for other in frames):  # A recording has no other frame there.
                frames.append(frame)
        progress("collecting")
    return frames


def _place(
    frames: Sequence[RgbdFrame], detector: ChangeDetector, threads: int
) -> tuple[dict[str, Observation], tuple[str, ...], int]:
    """Align frames with the map.

    Returns:
        The frames by name, the reasons for skipping others, and the number of changes that enough
        frames show.
    """
    placed, skipped = dict[str, Observation](), []
    window = max(len(frames), MIN_CHANGE_VIEWS)
    confirmation = ChangeConfirmation(MonitorConfig(window=window, needed=MIN_CHANGE_VIEWS))
    reports: list[Report] = []
    for number, frame in enumerate(frames):
        detection = detector.detect(frame)
        if detection.unreliable is not None:
            skipped.append(f"view {number}: {detection.unreliable}")
            continue
        view = refine_pose(detector.gaussian_map, Observation.of(frame), threads)
        if not np.linalg.norm(view.correction[:3, 3]) < MAX_CORRECTION_M:
            skipped.append(f"view {number} fits the map at another pose")
        else:
            placed[f"{number:03}"] = view
            rule = detector.config.objects
            reports += confirmation.observe(number, frame.time_s, detection.changes, rule)
    return placed, tuple(skipped), len(latest_reports(reports))


def _no_better(fit: Fit, split: FrameSplit, regions: Sequence[Region], threads: int) -> str | None:
    """Return the reason if the validation views do not fit better around the changes."""
    before_db, after_db = (
        region_psnr_db(part, split.validation, regions, threads) for part in (fit.before, fit.after)
    )
    if before_db is None or after_db is None:
        return "no validation view shows what changed"
    if after_db < before_db + MIN_GAIN_DB:
        return (
            f"validation views do not fit better: {before_db:.2f} dB before, {after_db:.2f} dB "
            "after"
        )
    return None
