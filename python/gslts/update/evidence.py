"""Decision whether the collected views confirm a detected change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Literal

import numpy as np

from gslts._core import detect as _core
from gslts.change.changes import Box, Change
from gslts.change.detection import Detection
from gslts.change.unknown import surface_fault
from gslts.core.boxes import common_volume, volume
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import relative, rotation, rotation_vector, transform
from gslts.types import Floats
from gslts.update.region import CORNERS, MAX_REGION_DISTANCE_M, Region, regions_of
from gslts.update.region_depths import MIN_SURFACE_PX, RegionDepths, depths_in_region
from gslts.update.views import View, region_masks

Verdict = Literal["shown", "not shown", "unknown"]

OCCLUSION_M = 0.15
"""A surface this much nearer than the region occludes it, m."""
MIN_VIEWS = 2
"""Minimum number of views of a region. One view cannot separate a change from an error of depth."""
PRIOR_LOG_ODDS = float(np.log(501 / 1525))
"""Log-odds of a change before any view is known: the confidence was fitted to 2,026 surfaces, of
which 501 were of changed objects (benchmarks/results/detection.md), and supposes this share."""
CLEAR_LOG_ODDS = 2.0
"""Evidence of a view that shows a change by its depths alone: two of them are enough. In two homes,
all 46 such views were of true changes."""
FAR_M = 2.5
"""Distance of a camera from a region beyond which the object has too few pixels, m."""
MAX_LOG_ODDS = 3.0
"""Bound of the evidence of one view, log-odds (20 to 1). Views share the errors of the map, so no
single view may outvote all others."""
GIVE_UP_LOG_ODDS = -3 * MAX_LOG_ODDS
"""Evidence at which no more views of a region are taken: as of three views that show nothing there.
Of the other six of a full tour, four would have to show it without doubt."""
MIN_MEASURED_SHARE = 0.1
"""Minimum share of changed pixels with measured depth; glass and mirrors have less."""
MIN_PART_SHARE = 0.5
"""Minimum share of the smaller of two boxes that lies in the other one, if both are reports of one
object: frames from two sides showed two thirds of a laptop's smaller box in the larger one."""
MAX_MOTION_GAP_M, MAX_MOTION_GAP_RAD = 0.03, np.deg2rad(4)
"""Maximum difference between two reports of one shift, at the centre of the object: one frame tells
the motion to about 1 cm and 2 degrees."""


def is_visible(frame: RgbdFrame, region: Region) -> bool:
    """Return whether a frame shows the centre of a region.

    Args:
        frame: RGB-D frame.
        region: Region of a change.

    Returns:
        True if the centre is inside of the image and its mask, and nothing measured occludes it.
    """
    center = region.project_center(frame.camera)
    if center is None:
        return False
    u, v, z = center
    if frame.mask is not None and not frame.mask[int(v), int(u)]:
        return False
    registered = frame if frame.depth_camera is None else frame.registered()
    depth = registered.depth[int(v), int(u)]
    margin_m = OCCLUSION_M + 0.5 * float(np.linalg.norm(region.high - region.low))
    return not bool(0 < depth < z - margin_m)


def confirm(
    change: Change,
    regions: Sequence[Region],
    views: Sequence[tuple[View, Detection]],
    skipped: Sequence[str],
) -> Change | str:
    """Confirm a change by the collected views.

    A relocation of which the views show one end only becomes an addition or a removal; no removal
    if the other end cannot be judged, as the map would lose the object. A shift gets the mean of
    the motions that the views agree on.

    Args:
        change: As detected.
        regions: Its regions.
        views: Views of these and of other regions, with their detections.
        skipped: Reasons for skipping other frames.

    Returns:
        The confirmed change, or the reason for rejecting it.
    """
    if not regions:
        return "its region is unknown"
    if change.kind == "shift":
        return _confirm_shift(change, regions, views, skipped)
    verdicts = [_judge(region, views, skipped) for region in regions]
    shown = [
        region for region, (verdict, _) in zip(regions, verdicts, strict=True) if verdict == "shown"
    ]
    if len(shown) == len(regions):
        return change
    loses_it = shown and shown[0].side == "before" and "unknown" in dict(verdicts)
    if shown and not loses_it:
        return change.end(shown[0].side)
    return next(reason for verdict, reason in verdicts if verdict != "shown")


def join_parts(changes: Sequence[Change]) -> tuple[list[Change], list[Change]]:
    """Join reports of one object that frames showed in parts; shifts are joined once confirmed.

    Args:
        changes: As detected.

    Returns:
        The changes, with the boxes of their parts, and the reports that are parts of them.
    """
    wholes: list[Change] = []
    parts: list[Change] = []
    for change in changes:
        for row, other in enumerate(wholes):
            if change.kind == other.kind != "shift" and _is_part(change, other):
                boxes = [_union([other.boxes[side], change.boxes[side]]) for side in (0, 1)]
                wholes[row] = replace(other, boxes=(boxes[0], boxes[1]))
                parts.append(change)
                break
        else:
            wholes.append(change)
    return wholes, parts


def join_shifts(results: Sequence[Change | str]) -> list[Change | str]:
    """Join confirmed shifts of one object, of which several parts were detected.

    Args:
        results: From `confirm`.

    Returns:
        The results; the first of such shifts has the boxes of all, and the others are rejected.
    """
    joined: list[Change | str] = []
    for result in results:
        if isinstance(result, str) or result.motion is None:
            joined.append(result)
            continue
        center = result.point
        for row, other in enumerate(joined):
            if (
                not isinstance(other, str)
                and other.motion is not None
                and _overlaps(other, regions_of(result))
                and _agree(other, result, center)
            ):
                boxes = [_union([other.boxes[side], result.boxes[side]]) for side in (0, 1)]
                joined[row] = replace(other, boxes=(boxes[0], boxes[1]))
                joined.append("it is a part of another shift")
                break
        else:
            joined.append(result)
    return joined


def _judge(
    region: Region, views: Sequence[tuple[View, Detection]], skipped: Sequence[str]
) -> tuple[Verdict, str]:
    """Return whether views show a change in a region, and the reason if not."""
    own = [(view, detection) for view, detection in views if is_visible(view.frame, region)]
    if len(own) < MIN_VIEWS:
        reason = skipped[0] if skipped else "the robot offers no other frame"
        return "unknown", f"{len(own)} view(s) show the change, {MIN_VIEWS} are needed: {reason}"
    evidence = [evidence_of(region, detection) for _, detection in own]
    judged = [value for value in evidence if not isinstance(value, str)]
    if len(judged) < MIN_VIEWS:
        reason = next(value for value in evidence if isinstance(value, str))
        return "unknown", f"{len(judged)} view(s) can judge it, {MIN_VIEWS} are needed: {reason}"
    if PRIOR_LOG_ODDS + sum(judged) <= 0:
        count = sum(value > 0 for value in judged)
        what = "a removed object" if region.side == "before" else "an added object"
        return "not shown", f"only {count} of {len(judged)} views show {what} there"
    changed = measured = 0
    for view, detection in own:
        before, after = region_masks(detection, view.changed.shape, [region])
        mask = before if region.side == "before" else after
        changed += int(mask.sum())
        measured += int(np.count_nonzero(view.depth[mask]))
    if measured < MIN_MEASURED_SHARE * changed:
        share = 100 * measured / changed
        return "unknown", f"depth is measured in {share:.0f} % of the changed pixels"
    return "shown", ""


def evidence_of(region: Region, detection: Detection) -> float | str:
    """Return what a view says of a change in a region, or why it cannot judge it.

    Where depth shows what no surface was made of, as it is small, was taken for a part of another
    one, or has the colour of what is behind it, nothing speaks against a change.

    Args:
        region: Of the change.
        detection: Of a view that shows the region.

    Returns:
        Bounded logarithm of the ratio of the odds of a change after and before this view.
    """
    own = [surface for surface in detection.surfaces if region.matches(surface)]
    faults = [surface_fault(surface) for surface in own]
    confidences = [
        _core.confidence(surface)
        for surface, fault in zip(own, faults, strict=True)
        if fault is None
    ]
    if not confidences and any(faults):
        return next(filter(None, faults))
    depths = depths_in_region(region, detection)
    if not own:
        if depths is not None and depths.shows_change:
            return CLEAR_LOG_ODDS
        if (reason := _why_overlooked(region, detection, depths)) is not None:
            return reason
    confidence = np.clip(max(confidences, default=0.0), 1e-9, 1 - 1e-9)
    log_odds = np.log(confidence / (1 - confidence)) - PRIOR_LOG_ODDS
    if log_odds < 0 and depths is not None and depths.has_step:
        return "depths differ there, but show no object by itself"
    return float(np.clip(log_odds, -MAX_LOG_ODDS, MAX_LOG_ODDS))


def _why_overlooked(
    region: Region, detection: Detection, depths: RegionDepths | None
) -> str | None:
    """Return why a change may have been overlooked where no surface of it was detected, or None."""
    center = region.project_center(detection.camera)
    if center is None:
        return "it shows only a part of it"
    u, v, z = center
    if z > FAR_M:
        return f"a change may be overlooked from {z:.1f} m"
    assert detection.labels is not None
    label = detection.labels[int(v), int(u)]
    if any(s.label == label and region.has_side_of(s) for s in detection.surfaces):
        return "another change covers it"
    if depths is None or depths.surface_px >= MIN_SURFACE_PX:
        return None
    if region.side == "after" and depths.past_px >= MIN_SURFACE_PX:
        return None  # Nothing came: the frame shows what is behind.
    return "it shows too little of it"


def _confirm_shift(
    change: Change,
    regions: Sequence[Region],
    views: Sequence[tuple[View, Detection]],
    skipped: Sequence[str],
) -> Change | str:
    """Confirm a shift by the views that report one at the same place, with the same motion."""
    center = np.mean([region.center for region in regions], axis=0)
    own = [
        detection
        for view, detection in views
        if any(is_visible(view.frame, region) for region in regions)
    ]
    if len(own) < MIN_VIEWS:
        reason = skipped[0] if skipped else "the robot offers no other frame"
        return f"{len(own)} view(s) show the change, {MIN_VIEWS} are needed: {reason}"
    reports = [
        (row, other)
        for row, detection in enumerate(own)
        for other in detection.changes
        if other.motion is not None and _overlaps(other, regions)
    ]
    groups = [
        [(row, other) for row, other in reports if _agree(report, other, center)]
        for _, report in reports
    ]
    agreeing = max(groups, key=_count_views, default=[])
    if _count_views(agreeing) < MIN_VIEWS:
        return f"only {_count_views(agreeing)} of {len(own)} views show the same shift there"
    shifts = [report for _, report in agreeing]
    motion = _mean_motion([shift.motion for shift in shifts if shift.motion is not None], center)
    before, after = (
        _union([report.boxes[side] for report in (change, *shifts)]) for side in (0, 1)
    )
    back = relative(motion, np.eye(4))
    boxes = (
        _union([before, _transform_box(after, back)]),
        _union([after, _transform_box(before, motion)]),
    )
    return replace(change, boxes=boxes, motion=motion)


def _count_views(reports: Sequence[tuple[int, Change]]) -> int:
    """Return the number of views among reports, each with the row of its view."""
    return len({row for row, _ in reports})


def _transform_box(box: Box | None, motion: Floats) -> Box | None:
    """Return the box around the corners of a box after a motion."""
    if box is None:
        return None
    corners = transform(motion, box[0] + CORNERS * (box[1] - box[0]))
    return corners.min(axis=0), corners.max(axis=0)


def _union(boxes: Sequence[Box | None]) -> Box | None:
    """Return the box around all known boxes; None if none is known."""
    known = [box for box in boxes if box is not None]
    if not known:
        return None
    lows, highs = zip(*known, strict=True)
    return np.min(lows, axis=0), np.max(highs, axis=0)


def _is_part(first: Change, second: Change) -> bool:
    """Return whether the boxes of two changes of a kind are those of one object, at each end."""
    shares = []
    for a, b in zip(first.boxes, second.boxes, strict=True):
        if a is not None and b is not None:
            smaller = min(volume(a), volume(b))
            shares.append(common_volume(a, b) / smaller if smaller > 0 else 0.0)
    return min(shares, default=0.0) >= MIN_PART_SHARE


def _overlaps(report: Change, regions: Sequence[Region]) -> bool:
    """Return whether the box of a change overlaps one of the regions, or is near it."""
    for box, region in product(report.boxes, regions):
        if box is not None and bool(
            np.all(box[0] <= region.high + MAX_REGION_DISTANCE_M)
            and np.all(box[1] >= region.low - MAX_REGION_DISTANCE_M)
        ):
            return True
    return False


def _agree(first: Change, second: Change, center: Floats) -> bool:
    """Return whether two shifts carry a point to the same position, by the same rotation."""
    assert first.motion is not None
    assert second.motion is not None
    gap_m = np.linalg.norm(transform(first.motion, center) - transform(second.motion, center))
    turn = relative(first.motion, second.motion)[:3, :3]
    angle_rad = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
    return bool(gap_m <= MAX_MOTION_GAP_M and angle_rad <= MAX_MOTION_GAP_RAD)


def _mean_motion(motions: Sequence[Floats], center: Floats) -> Floats:
    """Return [4,4] the mean of similar motions of an object: of its rotation and of its centre."""
    turn = rotation(np.mean([rotation_vector(motion[:3, :3]) for motion in motions], axis=0))
    moved = np.mean([transform(motion, center) for motion in motions], axis=0)
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = turn, moved - (turn * center).sum(axis=1)
    return result
