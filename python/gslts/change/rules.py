"""Changes from compared images, by our rule on surfaces of objects and by the rule of GS-LTS."""

from __future__ import annotations

import numpy as np

from gslts._core import detect as _core
from gslts.change.changes import Box, Change, Kind
from gslts.types import Bools, Ints32

KINDS: dict[_core.ChangeType, Kind] = {
    _core.ChangeType.ADDITION: "addition",
    _core.ChangeType.REMOVAL: "removal",
    _core.ChangeType.RELOCATION: "relocation",
}
"""Kinds by their C++ enumerator."""


def object_changes(
    surfaces: list[_core.Surface],
    labels: Ints32,
    rule: _core.ObjectRule,
    *,
    is_measured: bool = True,
) -> tuple[Change, ...]:
    """Return the changes that explain the surfaces of one image, by falling confidence.

    Args:
        surfaces: Surfaces visible in only one of map and frame.
        labels: [H,W] label of the surface at each pixel, 0 for none.
        rule: Thresholds.
        is_measured: False if surfaces of the frame have the depth of the map.

    Raises:
        ValueError: A threshold is out of range.
    """
    return tuple(
        _change(
            found,
            (_mask(labels, found.before), _mask(labels, found.after)),
            is_measured=is_measured or found.after is None,
        )
        for found in _core.classify_changes(surfaces, rule)
    )


def shift_change(found: _core.Shift, surfaces: list[_core.Surface], labels: Ints32) -> Change:
    """Convert a shift.

    Args:
        found: Result of `find_shifts`.
        surfaces: Surfaces among which it was found.
        labels: [H,W] label of the surface at each pixel, 0 for none.

    Returns:
        The change; the surface at either side is the largest one.
    """
    rows = [surfaces[row] for row in found.surfaces]
    before = [surface for surface in rows if surface.side == _core.Side.BEFORE]
    after = [surface for surface in rows if surface.side == _core.Side.AFTER]
    return Change(
        kind="shift",
        confidence=max(_core.confidence(surface) for surface in rows),
        point=np.mean(found.after, axis=0),
        boxes=(found.before, found.after),
        masks=(_masks(labels, before), _masks(labels, after)),
        before=max(before, key=_area_px, default=None),
        after=max(after, key=_area_px, default=None),
        motion=found.motion,
    )


def relocation_of(removal: Change, addition: Change, rule: _core.ObjectRule) -> Change | None:
    """Join a removal and an addition, possibly of two frames, if they are one moved object.

    Args:
        removal: First end, with its surface.
        addition: Second end, with its surface.
        rule: Thresholds.

    Returns:
        The relocation; None if the ends are not alike, or a surface is unknown.

    Raises:
        ValueError: A threshold is out of range.
    """
    if removal.before is None or addition.after is None:
        return None
    found = _core.classify_changes([removal.before, addition.after], rule)
    if len(found) != 1 or found[0].type != _core.ChangeType.RELOCATION:
        return None
    masks = removal.masks[0], addition.masks[1]
    return _change(found[0], masks, is_measured=addition.is_measured)


def gs_lts_change(found: _core.GsLtsChange, labels: Ints32) -> Change:
    """Convert a change found by the rule of GS-LTS (sec. III-C); it has no boxes.

    Args:
        found: Result of the rule.
        labels: [H,W] label of the mask component at each pixel, 0 for none.
    """
    mask = labels == found.first.label
    if found.second is not None:
        mask |= labels == found.second.label
    kind = KINDS[found.type]
    return Change(
        kind=kind,
        confidence=1.0,
        point=found.point_in_world,
        masks=(None if kind == "addition" else mask, None if kind == "removal" else mask),
    )


def _change(
    found: _core.ObjectChange, masks: tuple[Bools | None, Bools | None], *, is_measured: bool
) -> Change:
    visible = found.after if found.after is not None else found.before
    assert visible is not None  # Each change has one of them.
    return Change(
        kind=KINDS[found.type],
        confidence=found.confidence,
        point=visible.point,
        boxes=(_box(found.before), _box(found.after)),
        masks=masks,
        before=found.before,
        after=found.after,
        is_measured=is_measured,
    )


def _box(surface: _core.Surface | None) -> Box | None:
    return None if surface is None else (surface.low, surface.high)


def _mask(labels: Ints32, surface: _core.Surface | None) -> Bools | None:
    return None if surface is None else labels == surface.label


def _masks(labels: Ints32, surfaces: list[_core.Surface]) -> Bools | None:
    return np.isin(labels, [surface.label for surface in surfaces]) if surfaces else None


def _area_px(surface: _core.Surface) -> int:
    return surface.area_px
