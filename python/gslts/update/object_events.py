"""Records of the object changes that an update integrated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts._core.detect import Surface
from gslts.change.changes import Change
from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.map_semantics import MapSemantics
from gslts.store.causes import Appearance, Box, ChangeRecord, Motion
from gslts.store.records import Event, ObjectEvent
from gslts.types import Bools, Floats, Indices
from gslts.update.integrate import UpdateResult
from gslts.update.object_types import object_type
from gslts.update.region import Region
from gslts.update.selection import gaussians_in_regions

MIN_REMOVED, OUTLIER_SHARE = 20, 0.02
"""Minimum number of removed or moved Gaussians for a box, and the quantile trimmed as outliers."""


def object_events(
    before: GaussianMap,
    result: UpdateResult,
    events: Sequence[Event],
    semantics: MapSemantics | None = None,
) -> list[ObjectEvent]:
    """Return the record of each change that the updated map shows.

    Args:
        before: Map before the update.
        result: Accepted update.
        events: History of the map, oldest first.
        semantics: Of the map; names objects that no label names.

    Returns:
        One record per change. The box of a removed object is that of its Gaussians, because a
        detection may include the surface behind it; so are both boxes of a shifted one, because a
        detection shows only its edges.
    """
    removed = np.zeros(before.size, np.bool_)
    removed[before.rows_of_ids(result.delta.removed)] = True
    is_new = ~before.has_ids(result.part.ids)

    def name_added(region: Region) -> str | None:
        if semantics is None:
            return None
        boxes = ((view, region.project_box(view.camera, 0)) for view in result.views)
        frames = [
            (view.frame, box) for view, box in boxes if box is not None and view.shows_added(box)
        ]
        rows = np.flatnonzero(is_new & gaussians_in_regions(result.part, [region], 0.0))
        return semantics.name_in_frames(frames) or semantics.name_of(result.part, rows)

    records = []
    for row, change in enumerate(result.changes):
        own = removed
        if change.kind == "shift" and result.moved:
            own = result.moved[row]

        def rows_of(region: Region, own: Bools = own) -> Indices:
            return np.flatnonzero(own & gaussians_in_regions(before, [region], 0.0))

        def name_region(region: Region) -> str | None:
            return None if semantics is None else semantics.name_of(before, rows_of(region))

        old, new = change_boxes(change)
        if change.kind == "shift":
            rows = np.flatnonzero(own)
            old = _box_of(before, rows) or old
            kept = np.flatnonzero(own & ~removed)
            same = result.part.rows_of_ids(before.select(kept).ids)
            new = _box_of(result.part, same) or new
        elif change.boxes[0] is not None:
            old = _box_of(before, rows_of(Region("before", *change.boxes[0]))) or old
        records.append(
            ObjectEvent(
                kind=change.kind,
                type=object_type(change, result.views, events, name_region, name_added),
                boxes=(old, new),
                motion=_motion(change),
            )
        )
    return records


def change_record(change: Change) -> ChangeRecord:
    """Return the record of a detected change.

    Args:
        change: As detected.
    """
    return ChangeRecord(
        kind=change.kind,
        confidence=change.confidence,
        boxes=change_boxes(change),
        appearances=(_appearance(change.before), _appearance(change.after)),
        motion=_motion(change),
    )


def change_boxes(change: Change) -> tuple[Box | None, Box | None]:
    """Return the boxes of a change before and after, m; None where there is no object.

    Args:
        change: As detected.
    """
    before, after = (None if box is None else _box(*box) for box in change.boxes)
    return before, after


def _box_of(gaussian_map: GaussianMap, rows: Indices) -> Box | None:
    """Return the box around the centres of some Gaussians; None if they are too few."""
    if len(rows) < MIN_REMOVED:
        return None
    centers = gaussian_map.centers(rows)
    return _box(*np.quantile(centers, (OUTLIER_SHARE, 1 - OUTLIER_SHARE), axis=0))


def _motion(change: Change) -> Motion | None:
    if change.motion is None:
        return None
    first, second, third, last = (tuple(row) for row in change.motion.tolist())
    return first, second, third, last


def _appearance(surface: Surface | None) -> Appearance | None:
    if surface is None or not len(surface.color_histogram):
        return None
    roots = np.rint(255 * np.sqrt(np.asarray(surface.color_histogram, np.float64))).astype(int)
    colors = "".join(f"{bin_:03x}{roots[bin_]:02x}" for bin_ in np.flatnonzero(roots))
    return Appearance(colors=colors)


def _box(low: Floats, high: Floats) -> Box:
    (x0, y0, z0), (x1, y1, z1) = low.tolist(), high.tolist()
    return (x0, y0, z0), (x1, y1, z1)
