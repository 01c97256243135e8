"""Changes from surfaces: confidence thresholds, and ends joined to relocations."""

import numpy as np
import pytest
from change_images import BLUE, CAMERA, RED, RULE, blank, changes_in, gs_lts_change_at, put

from gslts._core import detect as core
from gslts._core.detect import ObjectRule
from gslts.change.changes import Change
from gslts.change.rules import relocation_of
from gslts.core.camera import Camera, at_pose, look_at

ELSEWHERE = at_pose(CAMERA, look_at(np.array([3.0, -1.0, 0.9]), np.array([1.0, 1.0, 0.3])))
Images = dict[str, np.ndarray]


def one_box(
    side: str,
    color: tuple[float, float, float] = RED,
    size: tuple[int, int] = (24, 20),
    depth_m: float = 1.6,
    camera: Camera = CAMERA,
) -> Change:
    """Return the change in an image in which only a box changed."""
    images = blank()
    put(images, side, (40, 20 if side == "before" else 100), size, depth_m, color)
    (change,) = changes_in(images, camera=camera)
    assert change.kind == ("removal" if side == "before" else "addition")
    return change


def doubtful() -> Images:
    """Return images of a map that is 3 cm off and a little brighter."""
    images = blank()
    images["rendered_depth"] += np.float32(0.03)
    images["rendered_rgb"] += np.float32(0.03)
    return images


def several() -> Images:
    """Return images with boxes of all colours, from a distinct one to barely visible ones."""
    images = doubtful()
    put(images, "after", (60, 60), (24, 20), 1.6, (0.9, 0.9, 0.0))
    put(images, "before", (10, 60), (24, 20), 1.94, (0.1, 0.9, 0.1))
    put(images, "before", (10, 10), (10, 10), 1.93, RED)
    put(images, "after", (60, 10), (8, 8), 1.94, BLUE)
    put(images, "after", (60, 110), (10, 10), 1.95, (0.57, 0.47, 0.53))
    return images


def test_changes_below_the_confidence_threshold_are_left_out() -> None:
    images = several()
    everything = changes_in(images, ObjectRule(min_confidence=0))
    confidences = [change.confidence for change in everything]
    assert len(confidences) == 5
    assert confidences == sorted(confidences, reverse=True)
    assert confidences[-1] < 0.7 < 0.85 < confidences[0] < 0.95
    for certain in (0.2, 0.5, 0.7, 0.9, 0.99, *confidences, 1.0):
        some = changes_in(images, ObjectRule(min_confidence=certain))
        kept = [confidence for confidence in confidences if confidence >= certain]
        assert [change.confidence for change in some] == kept
        for change, expected in zip(some, everything, strict=False):
            assert change.kind == expected.kind
            np.testing.assert_array_equal(change.point, expected.point)


@pytest.mark.parametrize("side", ["before", "after"])
def test_a_removal_or_an_addition_alone_is_never_sure(side: str) -> None:
    change = one_box(side)
    surface = change.before if side == "before" else change.after
    assert surface is not None
    assert core.confidence(surface) > 0.99
    assert 0.89 < change.confidence <= 0.9, "docs/changes.md names this bound"


def test_one_end_makes_the_other_more_likely() -> None:
    """A barely visible end is reported if a similar object is distinct elsewhere."""
    muted = (0.7, 0.4, 0.3)
    alone, unlike, alike = doubtful(), doubtful(), doubtful()
    for images in (alone, unlike, alike):
        put(images, "before", (60, 10), (10, 10), 1.95, muted)
    put(unlike, "after", (60, 100), (20, 18), 1.5, BLUE)
    put(alike, "after", (60, 100), (20, 18), 1.5, muted)
    (weak,) = changes_in(alone, ObjectRule(min_confidence=0))
    strict = ObjectRule(min_confidence=(0.9 + weak.confidence) / 2)
    assert changes_in(alone, strict) == ()
    (addition,) = changes_in(unlike, strict)
    assert addition.kind == "addition"
    (relocation,) = changes_in(alike, strict)
    assert relocation.kind == "relocation"
    assert relocation.confidence >= strict.min_confidence


def test_a_change_has_surfaces_and_masks_before_and_after() -> None:
    images = blank()
    put(images, "before", (40, 20))
    put(images, "after", (50, 100))
    (change,) = changes_in(images)
    assert change.kind == "relocation"
    assert change.before is not None
    assert change.after is not None
    np.testing.assert_array_equal(change.point, change.after.point)
    for surface, box, mask, corner in zip(
        (change.before, change.after),
        change.boxes,
        change.masks,
        ((40, 20), (50, 100)),
        strict=True,
    ):
        assert box is not None
        assert mask is not None
        np.testing.assert_array_equal(box, (surface.low, surface.high))
        assert (surface.low <= surface.point).all()
        assert (surface.point <= surface.high).all()
        rows, columns = np.nonzero(mask)
        assert (rows.min(), columns.min()) == corner
        assert (rows.max() + 1, columns.max() + 1) == (corner[0] + 24, corner[1] + 20)
        assert mask.sum() > 0.98 * 24 * 20
    removal = one_box("before")
    assert removal.before is not None
    assert removal.after is removal.boxes[1] is removal.masks[1] is None
    np.testing.assert_array_equal(removal.point, removal.before.point)


def test_similar_ends_of_two_frames_are_a_relocation() -> None:
    """The cameras may differ: the same box covers fewer pixels at a larger distance."""
    removal = one_box("before", depth_m=1.2, size=(32, 24))
    addition = one_box("after", depth_m=1.6, size=(24, 18), camera=ELSEWHERE)
    whole = relocation_of(removal, addition, RULE)
    assert whole is not None
    assert whole.kind == "relocation"
    assert removal.before is not None
    assert addition.after is not None
    ends = core.confidence(removal.before), core.confidence(addition.after)
    assert whole.confidence == max(ends) > max(removal.confidence, addition.confidence)
    assert whole.before is not None
    assert whole.after is not None
    np.testing.assert_array_equal(whole.before.point, removal.point)
    np.testing.assert_array_equal(whole.after.point, addition.point)
    np.testing.assert_array_equal(whole.point, addition.point)
    np.testing.assert_array_equal(whole.boxes[0], removal.boxes[0])
    np.testing.assert_array_equal(whole.boxes[1], addition.boxes[1])
    assert whole.masks[0] is removal.masks[0]
    assert whole.masks[1] is addition.masks[1]


def test_different_ends_are_no_relocation() -> None:
    removal, addition = one_box("before"), one_box("after")
    assert relocation_of(removal, addition, RULE) is not None
    assert relocation_of(removal, one_box("after", BLUE), RULE) is None
    small, large = one_box("before", size=(6, 5)), one_box("after", size=(60, 50))
    assert relocation_of(small, large, RULE) is None
    assert (
        relocation_of(removal, one_box("after", (0.8, 0.5, 0.1)), ObjectRule(min_match_score=0.9))
        is None
    )


def test_a_relocation_needs_a_removal_and_an_addition() -> None:
    removal, addition = one_box("before"), one_box("after")
    assert relocation_of(addition, removal, RULE) is None
    assert relocation_of(removal, removal, RULE) is None
    assert relocation_of(addition, addition, RULE) is None


def test_changes_of_gs_lts_have_no_surfaces_to_join() -> None:
    removal, addition = gs_lts_change_at("before"), gs_lts_change_at("after")
    assert (removal.kind, addition.kind) == ("removal", "addition")
    assert removal.boxes == addition.boxes == (None, None)
    assert removal.masks[1] is addition.masks[0] is None
    assert relocation_of(removal, addition, RULE) is None
    assert relocation_of(removal, one_box("after"), RULE) is None
    assert relocation_of(one_box("before"), addition, RULE) is None
    assert relocation_of(one_box("before"), one_box("after"), RULE) is not None


@pytest.mark.parametrize("name", ["min_confidence", "min_match_score", "min_flat_color"])
def test_thresholds_out_of_range_are_named(name: str) -> None:
    removal, addition = one_box("before"), one_box("after")
    for wrong in (-0.1, 3.1, float("nan")):
        with pytest.raises(ValueError, match=rf"^classify_changes: {name} must be in \["):
            relocation_of(removal, addition, ObjectRule(**{name: wrong}))
        with pytest.raises(ValueError, match=rf"^find_changed_surfaces: {name} must be in \["):
            changes_in(blank(), ObjectRule(**{name: wrong}))
