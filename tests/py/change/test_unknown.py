"""Regions of a frame in which changes cannot be judged."""

import numpy as np

from gslts._core.detect import Side, Surface, Visibility
from gslts.change.unknown import UnknownRegion, unknown_regions

SHAPE = (60, 80)
NO_LABELS = np.zeros(SHAPE, np.int32)
EVERYWHERE = np.ones(SHAPE, bool)


def with_hole(rows: slice, columns: slice) -> np.ndarray:
    """Return a mask that is false in a rectangle."""
    mask = EVERYWHERE.copy()
    mask[rows, columns] = False
    return mask


def boxes(regions: tuple[UnknownRegion, ...]) -> list[tuple[str, tuple[int, int, int, int]]]:
    """Return reason and box, in a frame of twice the size, of each region."""
    return [(region.reason, region.box_px(160)) for region in regions]


def test_what_can_be_judged_is_not_listed() -> None:
    assert unknown_regions(EVERYWHERE, EVERYWHERE, [], NO_LABELS) == ()


def test_regions_tell_their_reason_and_box() -> None:
    known = with_hole(slice(0, 10), slice(0, 20))
    measured = with_hole(slice(30, 40), slice(40, 60)) & known
    assert boxes(unknown_regions(known, measured, [], NO_LABELS)) == [
        ("the map does not cover it", (0, 0, 40, 20)),
        ("no depth is measured", (80, 60, 120, 80)),
    ]


def test_single_pixels_are_not_listed() -> None:
    assert unknown_regions(with_hole(slice(5, 6), slice(5, 6)), EVERYWHERE, [], NO_LABELS) == ()


def test_surfaces_that_no_camera_saw_are_listed() -> None:
    labels = NO_LABELS.copy()
    labels[10:20, 10:20], labels[40:50, 40:50] = 1, 2
    surfaces = [
        Surface(
            side=Side.AFTER,
            point=(0, 0, 1),
            low=(0, 0, 1),
            high=(0, 0, 1),
            label=label,
            visibility=Visibility(on_surface=1, seen_through=1, known_share=share),
        )
        for label, share in ((1, 0.2), (2, 0.9))
    ]
    found = unknown_regions(EVERYWHERE, EVERYWHERE, surfaces, labels)
    assert boxes(found) == [("no training camera saw this place", (20, 20, 40, 40))]
