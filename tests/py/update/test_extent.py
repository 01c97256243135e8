"""Growing of detected regions to whole objects."""

from dataclasses import replace
from functools import cache

import change_room
import numpy as np
import pytest
import sim_scenes
from change_room import BLOCK_TOP_M, VIEWPOINTS, YELLOW

from gslts.rendering.losses import Exposure
from gslts.update.extent import extend_regions
from gslts.update.region import Region
from gslts.update.views import View, pixels_in_region
from gslts_sim.home import Home

LOW, HIGH = np.array([2.35, 1.55, BLOCK_TOP_M]), np.array([2.8, 2.0, BLOCK_TOP_M + 0.008])
"""Corners of a sheet of paper on the block."""
SHEET = Region("after", LOW, HIGH)
PART = Region("after", LOW, np.array([2.45, 1.65, HIGH[2]]))
"""The part of it that a detector may report."""

MAX_REGION_DISTANCE_M = 0.12
"""A voxel, and the blur of small images."""


def with_sheet() -> Home:
    room = change_room.home()
    sheet = sim_scenes.box_object("Paper|1", tuple(LOW), tuple(HIGH), YELLOW)
    return replace(room, objects=(*room.objects, replace(sheet, movable=True, parent="Block|1")))


@cache
def views(*, changed: bool) -> tuple[View, ...]:
    """Return views of the block without detections, and renderings of the block as it was."""
    seen = []
    for viewpoint in VIEWPOINTS:
        frame = change_room.see(with_sheet() if changed else change_room.home(), viewpoint)
        old = change_room.see(change_room.home(), viewpoint, "kinect")
        colors = old.rgb.astype(np.float32) / np.float32(255)
        nothing = np.zeros(frame.depth.shape, np.bool_)
        seen.append(View(frame, Exposure(), old.depth, colors, nothing, nothing))
    return tuple(seen)


def test_a_flat_object_is_found_by_its_color() -> None:
    (region,), larger = extend_regions([PART], views(changed=True))
    np.testing.assert_allclose(region.low, LOW, atol=MAX_REGION_DISTANCE_M)
    np.testing.assert_allclose(region.high, HIGH, atol=MAX_REGION_DISTANCE_M)
    for view in larger:
        sheet = pixels_in_region(view.depth, view.camera, SHEET, 0.005)
        assert sheet.sum() > 100
        assert view.after[sheet].mean() > 0.9
        around = pixels_in_region(view.depth, view.camera, SHEET, MAX_REGION_DISTANCE_M)
        assert not view.after[~around].any()
        assert not view.before.any()


@pytest.mark.parametrize("side", ["before", "after"])
def test_a_region_without_change_does_not_grow(side: str) -> None:
    alone = replace(PART, side=side)
    (region,), larger = extend_regions([alone], views(changed=False))
    np.testing.assert_array_equal((region.low, region.high), (alone.low, alone.high))
    assert not any(view.changed.any() for view in larger)


def test_changed_illumination_is_no_added_object() -> None:
    """Brightness rises from one side of the images to the other."""
    lit = []
    for view in views(changed=False):
        columns = np.arange(view.rendered_rgb.shape[1], dtype=np.float32)[None, :, None]
        shown = view.rendered_rgb / (1 + columns / columns.max())
        lit.append(replace(view, rendered_rgb=shown))
    assert (
        np.mean([np.abs(view.colors - view.rendered_rgb).max(axis=2) > 0.1 for view in lit]) > 0.5
    )
    (region,), larger = extend_regions([PART], lit)
    np.testing.assert_array_equal((region.low, region.high), (PART.low, PART.high))
    assert not any(view.changed.any() for view in larger)


def test_color_does_not_grow_removed_regions() -> None:
    """Otherwise moving light would remove the floor."""
    gone = replace(PART, side="before")
    (region,), larger = extend_regions([gone], views(changed=True))
    np.testing.assert_array_equal((region.low, region.high), (gone.low, gone.high))
    assert not any(view.changed.any() for view in larger)


@pytest.mark.parametrize(("quantum_m", "grows"), [(0.0, True), (0.039, False)])
def test_coarse_depth_does_not_grow_regions(quantum_m: float, grows: bool) -> None:
    """The map has all surfaces farther away."""
    stepped = [
        replace(view, rendered_depth=view.rendered_depth + 0.2, depth_quantum_m=quantum_m)
        for view in views(changed=False)
    ]
    (region,), larger = extend_regions([PART], stepped)
    assert (np.prod(region.high - region.low) > 10 * np.prod(PART.high - PART.low)) == grows
    assert any(view.changed.any() for view in larger) == grows


def test_given_views_are_not_modified() -> None:
    given = views(changed=True)
    extend_regions([PART], given)
    assert not any(view.changed.any() for view in given)
