"""Whether views show that something changed at a place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from gslts._core import detect as _core
from gslts.change.changes import Change
from gslts.change.detector import Detection
from gslts.core.frame import RgbdFrame
from gslts.update.region import Region
from gslts.update.views import View, masks_of

Answer = Literal["shown", "not shown", "not known"]

INSIDE = 0.06
"""Share of the image's width by which the middle of a region must lie within it."""
HIDDEN_M = 0.15
"""What is measured so much before a region hides it."""
LEAST_VIEWS = 2
MOST_LOG_ODDS = 3.0
"""Of a change, by one view: 20 to 1 for it at most, and as much against it where nothing is seen.
What all views tell is their sum; as they share the errors of the map, none may decide alone."""
LEAST_MEASURED = 0.1
"""Share of what changed in which depth must be measured."""


def shows(frame: RgbdFrame, region: Region) -> bool:
    """Whether the middle of a region is in a frame and nothing is before it."""
    camera = frame.camera
    middle = region.middle_in(camera)
    if middle is None:
        return False
    u, v, z = middle
    margin = INSIDE * camera.width
    if not (margin <= u < camera.width - margin and margin <= v < camera.height - margin):
        return False
    depth = frame.registered().depth[int(v), int(u)]
    reach_m = HIDDEN_M + 0.5 * float(np.linalg.norm(region.high - region.low))
    return not bool(0 < depth < z - reach_m)


def shown_of(
    change: Change,
    regions: Sequence[Region],
    seen: Sequence[tuple[View, Detection]],
    skipped: Sequence[str],
) -> Change | str:
    """What views show of a change, or why it is none.

    An object that moved is only new, or only gone, if views of its other place show no change.

    Args:
        change: As detected.
        regions: Where it is to be seen.
        seen: Views of these and of other places, and what was detected in them.
        skipped: Why other frames do not count.
    """
    if not regions:
        return "its place is not known"
    answers = [_judged(region, seen, skipped) for region in regions]
    shown = [region for region, (what, _) in zip(regions, answers, strict=True) if what == "shown"]
    if len(shown) == len(regions):
        return change
    if shown and not any(what == "not known" for what, _ in answers):
        return change.end(shown[0].side)
    return next(why for what, why in answers if what != "shown")


def _judged(
    region: Region, seen: Sequence[tuple[View, Detection]], skipped: Sequence[str]
) -> tuple[Answer, str]:
    """Whether views show a change at a place, and why if they do not."""
    own = [(view, detection) for view, detection in seen if shows(view.frame, region)]
    if len(own) < LEAST_VIEWS:
        why = skipped[0] if skipped else "the robot offers no other frame"
        return "not known", f"{len(own)} view(s) show the change, {LEAST_VIEWS} are needed: {why}"
    log_odds = [_log_odds(region, detection) for _, detection in own]
    if sum(log_odds) <= 0:
        showing = sum(one > 0 for one in log_odds)
        what = "something gone" if region.side == "before" else "something new"
        return "not shown", f"only {showing} of {len(own)} views show {what} there"
    masks = []
    for view, detection in own:
        before, after = masks_of(detection, view.changed.shape, [region])
        masks.append(before if region.side == "before" else after)
    changed = sum(int(mask.sum()) for mask in masks)
    measured = sum(
        int(np.count_nonzero(view.depth[mask])) for (view, _), mask in zip(own, masks, strict=True)
    )
    if measured < LEAST_MEASURED * changed:
        share = 100 * measured / changed
        return "not known", f"depth is measured in {share:.0f} % of what changed"
    return "shown", ""


def _log_odds(region: Region, detection: Detection) -> float:
    """How likely one view makes a change at a region, as the logarithm of the odds, bounded."""
    certainties = [_core.confidence(one) for one in detection.surfaces if region.is_of(one)]
    certainty = np.clip(max(certainties, default=0.0), 1e-9, 1 - 1e-9)
    return float(np.clip(np.log(certainty / (1 - certainty)), -MOST_LOG_ODDS, MOST_LOG_ODDS))
