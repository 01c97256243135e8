"""Checks whether a frame shows the scene of the rendering."""

import numpy as np
import pytest
from change_images import boxes

from gslts.change.depth_quality import DepthQuality
from gslts.change.features import OrientedGradients, similarity
from gslts.change.reliability import appearance_fault, depth_fault

HEIGHT, WIDTH = 90, 120
KNOWN = np.ones((HEIGHT, WIDTH), np.bool_)


def fault_of(
    observed: np.ndarray, rendered: np.ndarray, depth: DepthQuality = "fine"
) -> str | None:
    """Compare two images by their features."""
    first, second = (OrientedGradients()(np.ascontiguousarray(i)) for i in (observed, rendered))
    cosines = similarity(first, second, HEIGHT, WIDTH)
    return appearance_fault((first, second), cosines, KNOWN, depth)


@pytest.mark.parametrize(
    ("share", "with_depth", "without"),
    [(0.0, True, True), (0.3, True, True), (0.55, True, False), (0.8, False, False)],
)
def test_much_may_differ_in_an_aligned_frame(share: float, with_depth: bool, without: bool) -> None:
    observed = boxes(0).copy()
    columns = slice(0, round(share * WIDTH))
    observed[:, columns] = boxes(1)[:, columns]
    assert (fault_of(observed, boxes(0)) is None) == with_depth
    assert (fault_of(observed, boxes(0), "none") is None) == without


def test_without_a_known_pixel_nothing_can_be_compared() -> None:
    features = OrientedGradients()(np.ascontiguousarray(boxes(0)))
    cosines = np.ones((HEIGHT, WIDTH), np.float32)
    fault = appearance_fault((features, features), cosines, ~KNOWN, "fine")
    assert fault == "no part of the view can be compared"


@pytest.mark.parametrize("roll_px", [0, 12, 30])
def test_an_image_of_elsewhere_is_a_fault(roll_px: int) -> None:
    fault = fault_of(np.roll(boxes(0)[:, ::-1], roll_px, axis=1), boxes(0))
    assert fault is not None
    assert "appear different: pose, intrinsics or scale are wrong" in fault


@pytest.mark.parametrize(
    ("agreeing", "depth", "is_same"),
    [
        (0.55, "fine", True),
        (0.45, "fine", False),
        (0.45, "coarse", True),
        (0.35, "coarse", False),
        (0.0, "none", True),
    ],
)
def test_depths_must_agree_in_a_share_of_the_pixels(
    agreeing: float, depth: DepthQuality, is_same: bool
) -> None:
    rendered = np.full((HEIGHT, WIDTH), 2.0, np.float32)
    observed = rendered.copy()
    observed[:, round(agreeing * WIDTH) :] = 3.0
    assert (depth_fault(observed, rendered, KNOWN, depth) is None) == is_same


def test_without_a_common_depth_nothing_can_be_compared() -> None:
    nothing = np.zeros((HEIGHT, WIDTH), np.float32)
    fault = depth_fault(nothing, nothing + 2, KNOWN, "fine")
    assert fault == "no depth is measured where the map is known"
