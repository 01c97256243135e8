"""`gslts._core.detect` on images made by hand: additions, removals and relocations of boxes."""

import numpy as np
import pytest
from change_images import CAMERA, HEIGHT, POSE, WALL_M, WIDTH, at, blank, classify, put
from hypothesis import given
from hypothesis import strategies as st

from gslts._core.detect import ChangeType


def test_equal_images_have_no_change() -> None:
    changes, labels = classify(blank())
    assert changes == []
    assert labels.shape == (HEIGHT, WIDTH)
    assert labels.dtype == np.int32
    assert not labels.any()


@pytest.mark.parametrize(
    ("side", "kind"), [("after", ChangeType.ADDITION), ("before", ChangeType.REMOVAL)]
)
def test_a_box_is_found_at_its_position(side: str, kind: ChangeType) -> None:
    images = blank()
    put(images, side, (40, 90))
    changes, labels = classify(images)
    assert [change.type for change in changes] == [kind]
    surface = changes[0].after if side == "after" else changes[0].before
    assert (changes[0].before is None) == (side == "after")
    assert (changes[0].after is None) == (side == "before")
    np.testing.assert_allclose(surface.point, at(52, 100, 1.6), atol=0.006)
    np.testing.assert_allclose(surface.color, (0.9, 0.2, 0.1), atol=1e-3)
    assert surface.area_m2 == pytest.approx(24 * 20 * 1.6**2 / (150 * 160), rel=0.02)
    assert surface.step_m == pytest.approx(0.4, abs=1e-3)
    assert not surface.flat
    rows, columns = np.nonzero(labels == surface.label)
    assert (rows.min(), rows.max() + 1) == (40, 64)
    assert (columns.min(), columns.max() + 1) == (90, 110)
    assert 0.85 < changes[0].confidence <= 1


def test_a_relocated_box_is_one_relocation() -> None:
    images = blank()
    put(images, "before", (40, 20))
    put(images, "after", (50, 100))
    (change,), _ = classify(images)
    assert change.type == ChangeType.RELOCATION
    np.testing.assert_allclose(change.before.point, at(52, 30, 1.6), atol=0.006)
    np.testing.assert_allclose(change.after.point, at(62, 110, 1.6), atol=0.006)


def test_boxes_of_other_colours_are_two_changes() -> None:
    images = blank()
    put(images, "before", (40, 20))
    put(images, "after", (50, 100), color=(0.1, 0.2, 0.9))
    changes, labels = classify(images)
    assert {change.type for change in changes} == {ChangeType.REMOVAL, ChangeType.ADDITION}
    assert sorted(np.unique(labels)) == [0, 1, 2]


def test_unknown_parts_of_the_map_have_no_change() -> None:
    images = blank()
    put(images, "after", (40, 90))
    images["alpha"][30:80, 80:120] = 0.5
    assert classify(images)[0] == []


@pytest.mark.parametrize("missing", [0.0, np.nan])
def test_without_depth_there_is_no_step(missing: float) -> None:
    images = blank()
    put(images, "after", (40, 90))
    images["observed_depth"][30:80, 80:120] = missing
    assert classify(images)[0] == []


@given(
    corner=st.tuples(st.integers(20, 60), st.integers(20, 90)),
    shift=st.tuples(st.integers(-12, 12), st.integers(-12, 12)),
    depth_m=st.floats(1.0, 1.7),
    side=st.sampled_from(["before", "after"]),
)
def test_a_shift_of_both_images_shifts_the_changes(
    corner: tuple[int, int], shift: tuple[int, int], depth_m: float, side: str
) -> None:
    here, there = blank(), blank()
    for images, position in (
        (here, corner),
        (there, (corner[0] + shift[0], corner[1] + shift[1])),
    ):
        put(images, side, position, depth_m=depth_m)
        put(images, "after", (position[0] + 2, position[1] + 40), (12, 12), 1.8, (0.1, 0.3, 0.9))
    changes, labels = classify(here)
    shifted, shifted_labels = classify(there)
    np.testing.assert_array_equal(np.roll(labels, shift, axis=(0, 1)), shifted_labels)
    assert [change.type for change in changes] == [change.type for change in shifted]
    assert len(changes) == 2
    for change, other in zip(changes, shifted, strict=True):
        assert other.confidence == pytest.approx(change.confidence)
        a, b = (end.after if end.after is not None else end.before for end in (change, other))
        z = WALL_M - a.step_m
        step = np.array([shift[1] / CAMERA.fx * z, shift[0] / CAMERA.fy * z, 0])
        np.testing.assert_allclose(b.point - a.point, POSE[:3, :3] @ step, atol=1e-5)
        np.testing.assert_allclose(b.low - a.low, POSE[:3, :3] @ step, atol=1e-5)


@given(
    rows=st.integers(6, 40),
    columns=st.integers(6, 40),
    depth_m=st.floats(0.8, 1.6),
)
def test_swapped_images_swap_additions_and_removals(
    rows: int, columns: int, depth_m: float
) -> None:
    images = blank()
    put(images, "after", (30, 50), (rows, columns), depth_m)
    exchanged = {
        "observed_rgb": images["rendered_rgb"],
        "rendered_rgb": images["observed_rgb"],
        "observed_depth": images["rendered_depth"],
        "rendered_depth": images["observed_depth"],
        "alpha": images["alpha"],
        "similarity": images["similarity"],
    }
    additions, removals = classify(images)[0], classify(exchanged)[0]
    assert [change.type for change in additions] == [ChangeType.ADDITION]
    # The slope that is forgiven is that of the map, so that a border may differ by a pixel.
    assert [change.type for change in removals] == [ChangeType.REMOVAL]
    np.testing.assert_allclose(additions[0].after.point, removals[0].before.point, atol=0.02)
