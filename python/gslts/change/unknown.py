"""Regions of a frame in which changes cannot be judged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from gslts._core.detect import Surface
from gslts.change.changes import box_of_mask
from gslts.change.constants import MIN_SEEN_SHARE, MIN_UNKNOWN_SHARE
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

    def box_px(self, width: int) -> tuple[int, int, int, int]:
        """Return the box around the region in the image.

        Args:
            width: Width of the frame, px; the mask may be of a halved image.

        Returns:
            (x0, y0, x1, y1) in the pixels of the frame, x1 and y1 exclusive.
        """
        box = box_of_mask(self.mask, width)
        assert box is not None  # A region has pixels.
        return box


def unknown_regions(
    known: Bools, measured: Bools, surfaces: Sequence[Surface], labels: Ints32
) -> tuple[UnknownRegion, ...]:
    """List the regions of a compared frame in which changes cannot be judged.

    Args:
        known: [H,W] pixels that the map covers, and the mask of the frame, if it has one.
        measured: [H,W] pixels that can be compared otherwise: with a depth, where depth decides.
        surfaces: Surfaces visible in only one of map and frame.
        labels: [H,W] label of the surface at each pixel, 0 for none.
    """
    regions = [UnknownRegion(mask, "the map does not cover it") for mask in _components(~known)]
    regions += [
        UnknownRegion(mask, "no depth is measured") for mask in _components(known & ~measured)
    ]
    for surface in surfaces:
        seen = surface.visibility
        if seen is not None and seen.known_share < MIN_SEEN_SHARE:
            mask = labels == surface.label
            regions.append(UnknownRegion(mask, "no training camera saw this place"))
    return tuple(regions)


def _components(mask: Bools) -> Iterator[Bools]:
    """Yield the connected components of a mask that are large enough to tell."""
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    for label in range(1, count):
        if statistics[label, cv2.CC_STAT_AREA] >= MIN_UNKNOWN_SHARE * mask.size:
            yield labels == label
