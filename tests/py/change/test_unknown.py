"""Regions of a frame in which changes cannot be judged."""

import numpy as np
import pytest

from gslts._core.detect import Side, Surface, Visibility
from gslts.change.unknown import UnknownRegion, surface_fault, unknown_regions

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
    assert unknown_regions({"the image is blurred": ~EVERYWHERE}, [], NO_LABELS) == ()


def test_regions_tell_their_first_reason_and_box() -> None:
    unknown = {
        "the map does not cover it": ~with_hole(slice(0, 10), slice(0, 20)),
        "no depth is measured": ~with_hole(slice(0, 20), slice(0, 20)),
    }
    assert boxes(unknown_regions(unknown, [], NO_LABELS)) == [
        ("the map does not cover it", (0, 0, 40, 20)),
        ("no depth is measured", (0, 20, 40, 40)),
    ]


def test_single_pixels_are_not_listed() -> None:
    unknown = {"no depth is measured": ~with_hole(slice(5, 6), slice(5, 6))}
    assert unknown_regions(unknown, [], NO_LABELS) == ()


@pytest.mark.parametrize(
    ("side", "seen", "fault"),
    [
        (Side.AFTER, Visibility(on_surface=1, seen_through=1, known_share=0.9), None),
        (Side.BEFORE, Visibility(on_surface=9, seen_through=1, known_share=0.9), None),
        (
            Side.AFTER,
            Visibility(on_surface=1, seen_through=1, known_share=0.2),
            "too few training cameras saw this position",
        ),
        (
            Side.BEFORE,
            Visibility(on_surface=5, seen_through=5, known_share=0.9),
            "training cameras saw through this surface of the map",
        ),
    ],
)
def test_surfaces_that_training_cameras_contradict_are_listed(
    side: Side, seen: Visibility, fault: str | None
) -> None:
    labels = NO_LABELS.copy()
    labels[10:20, 10:20] = 1
    surface = Surface(
        side=side, point=(0, 0, 1), low=(0, 0, 1), high=(0, 0, 1), label=1, visibility=seen
    )
    assert surface_fault(surface) == fault
    found = boxes(unknown_regions({}, [surface], labels))
    assert found == ([] if fault is None else [(fault, (20, 20, 40, 40))])


def test_a_surface_without_visibility_has_no_fault() -> None:
    surface = Surface(side=Side.BEFORE, point=(0, 0, 1), low=(0, 0, 1), high=(0, 0, 1))
    assert surface_fault(surface) is None
