"""Regions of a frame in which changes cannot be judged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from gslts._core.detect import Side, Surface
from gslts.change.constants import (
    MAX_MISSING_SHARE,
    MAX_RECORDED_SHARE,
    MAX_THROUGH_SHARE,
    MIN_FREE_SHARE,
    MIN_SEEN_SHARE,
    MIN_UNKNOWN_SHARE,
)
from gslts.semantics.masks import PixelBox, box_of_mask
from gslts.types import Bools, Ints32


@dataclass(frozen=True, eq=False)
class UnknownRegion:
    """A region in which changes cannot be judged.

    Attributes:
        mask: [H,W] its pixels.
        reason: Why they cannot.
    """

    mask: Bools
    reason: str

    def box_px(self, width: int) -> PixelBox:
        """Return the box around the region in the image.

        Args:
            width: Width of the frame, px; the mask may be of a halved image.

        Returns:
            (x0, y0, x1, y1) in the pixels of the frame, x1 and y1 exclusive.
        """
        box = box_of_mask(self.mask, width)
        assert box is not None  # A region has pixels.
        return box


def surface_fault(surface: Surface) -> str | None:
    """Check a surface that only one of map and frame shows, by the training cameras of the map.

    Args:
        surface: With its visibility; without it nothing is known against it.

    Returns:
        The reason why it is no sign of a change; None if it may be one.
    """
    seen = surface.visibility
    if seen is None:
        return None
    if seen.known_share < MIN_SEEN_SHARE:
        return "too few training cameras saw this position"
    total = seen.on_surface + seen.seen_through
    if surface.side == Side.BEFORE and seen.seen_through > MAX_THROUGH_SHARE * total:
        return "training cameras saw through this surface of the map"
    if seen.recorded_share >= MAX_RECORDED_SHARE:
        return "the recording of the map measured this surface"
    if seen.free_share < MIN_FREE_SHARE:
        return "the recording of the map did not see through this position"
    if seen.missing_share > MAX_MISSING_SHARE:
        return "the recording of the map saw through this surface"
    return None


def unknown_regions(
    reasons: Mapping[str, Bools], surfaces: Sequence[Surface], labels: Ints32
) -> tuple[UnknownRegion, ...]:
    """List the regions of a compared frame in which changes cannot be judged.

    Args:
        reasons: [H,W] pixels that cannot be compared, by the reason; of a pixel with several, the
            first one counts.
        surfaces: Surfaces visible in only one of map and frame.
        labels: [H,W] label of the surface at each pixel, 0 for none.
    """
    regions = []
    listed = np.zeros(labels.shape, np.bool_)
    for reason, mask in reasons.items():
        regions += [UnknownRegion(part, reason) for part in _components(mask & ~listed)]
        listed |= mask
    for surface in surfaces:
        fault = surface_fault(surface)
        if fault is not None:
            regions.append(UnknownRegion(labels == surface.label, fault))
    return tuple(regions)


def _components(mask: Bools) -> Iterator[Bools]:
    """Yield the connected components of a mask that are large enough to tell."""
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    for label in range(1, count):
        if statistics[label, cv2.CC_STAT_AREA] >= MIN_UNKNOWN_SHARE * mask.size:
            yield labels == label
