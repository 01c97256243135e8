"""Decision whether the collected views confirm a detected change."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from gslts._core import detect as _core
from gslts.change.changes import Change
from gslts.change.detector import Detection
from gslts.core.frame import RgbdFrame
from gslts.update.region import Region
from gslts.update.views import View, region_masks

Verdict = Literal["shown", "not shown", "unknown"]

BORDER_SHARE = 0.06
"""Margin between the centre of a region and the border of the image, as a share of its width."""
OCCLUSION_M = 0.15
"""A surface this much nearer than the region occludes it, m."""
MIN_VIEWS = 2
"""Minimum number of views of a region. One view cannot separate a change from an error of depth."""
MAX_LOG_ODDS = 3.0
"""Bound of the evidence of one view, log-odds (20 to 1). Views share the errors of the map, so no
single view may outvote all others."""
MIN_MEASURED_SHARE = 0.1
"""Minimum share of changed pixels with measured depth; glass and mirrors have less."""


def is_visible(frame: RgbdFrame, region: Region) -> bool:
    """Return whether a frame shows the centre of a region.

    Args:
        frame: RGB-D frame.
        region: Region of a change.

    Returns:
        True if the centre is inside of the image and nothing measured occludes it.
    """
    camera = frame.camera
    center = region.project_center(camera)
    if center is None:
        return False
    u, v, z = center
    margin = BORDER_SHARE * camera.width
    if not (margin <= u < camera.width - margin and margin <= v < camera.height - margin):
        return False
    depth = frame.registered().depth[int(v), int(u)]
    margin_m = OCCLUSION_M + 0.5 * float(np.linalg.norm(region.high - region.low))
    return not bool(0 < depth < z - margin_m)


def confirm(
    change: Change,
    regions: Sequence[Region],
    views: Sequence[tuple[View, Detection]],
    skipped: Sequence[str],
) -> Change | str:
    """Confirm a change by the collected views.

    A relocation becomes an addition or a removal if the views show that one end did not change.

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
    verdicts = [_judge(region, views, skipped) for region in regions]
    shown = [
        region for region, (verdict, _) in zip(regions, verdicts, strict=True) if verdict == "shown"
    ]
    if len(shown) == len(regions):
        return change
    if shown and not any(verdict == "unknown" for verdict, _ in verdicts):
        return change.end(shown[0].side)
    return next(reason for verdict, reason in verdicts if verdict != "shown")


def _judge(
    region: Region, views: Sequence[tuple[View, Detection]], skipped: Sequence[str]
) -> tuple[Verdict, str]:
    """Return whether views show a change in a region, and the reason if not."""
    own = [(view, detection) for view, detection in views if is_visible(view.frame, region)]
    if len(own) < MIN_VIEWS:
        reason = skipped[0] if skipped else "the robot offers no other frame"
        return "unknown", f"{len(own)} view(s) show the change, {MIN_VIEWS} are needed: {reason}"
    log_odds = [_log_odds(region, detection) for _, detection in own]
    if sum(log_odds) <= 0:
        count = sum(value > 0 for value in log_odds)
        what = "a removed object" if region.side == "before" else "an added object"
        return "not shown", f"only {count} of {len(own)} views show {what} there"
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


def _log_odds(region: Region, detection: Detection) -> float:
    """Return the bounded log-odds of a change in a region, from one view."""
    confidences = [
        _core.confidence(surface) for surface in detection.surfaces if region.matches(surface)
    ]
    confidence = np.clip(max(confidences, default=0.0), 1e-9, 1 - 1e-9)
    return float(np.clip(np.log(confidence / (1 - confidence)), -MAX_LOG_ODDS, MAX_LOG_ODDS))
