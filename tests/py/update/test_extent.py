"""How far a change reaches beyond what was detected of it."""

from dataclasses import replace
from functools import cache

import change_room
import numpy as np
import pytest
import sim_scenes
from change_room import BLOCK_TOP_M, LOOKS, YELLOW

from gslts.rendering.losses import Exposure
from gslts.update.extent import extended
from gslts.update.region import Region
from gslts.update.views import View, near_region
from gslts_sim.home import Home

LOW, HIGH = np.array([2.35, 1.55, BLOCK_TOP_M]), np.array([2.8, 2.0, BLOCK_TOP_M + 0.008])
"""Corners of a sheet of paper on the block."""
SHEET = Region("after", LOW, HIGH)
CORNER = Region("after", LOW, np.array([2.45, 1.65, HIGH[2]]))
"""As much as a detector may have told of it."""

NEAR_M = 0.12
"""A voxel, and what is blurred in pictures as small as these."""


def with_sheet() -> Home:
    room = change_room.home()
    sheet = sim_scenes.box_object("Paper|1", tuple(LOW), tuple(HIGH), YELLOW)
    return replace(room, objects=(*room.objects, replace(sheet, movable=True, parent="Block|1")))


@cache
def views(*, changed: bool) -> tuple[View, ...]:
    """Of the block, in which nothing was detected, and of a map that shows it as it was."""
    seen = []
    for look in LOOKS:
        frame = change_room.see(with_sheet() if changed else change_room.home(), look)
        old = change_room.see(change_room.home(), look, "kinect")
        colors = old.rgb.astype(np.float32) / np.float32(255)
        nothing = np.zeros(frame.depth.shape, np.bool_)
        seen.append(View(frame, Exposure(), old.depth, colors, nothing, nothing))
    return tuple(seen)


def test_what_lies_flat_is_told_by_its_colour() -> None:
    (region,), larger = extended([CORNER], views(changed=True))
    np.testing.assert_allclose(region.low, LOW, atol=NEAR_M)
    np.testing.assert_allclose(region.high, HIGH, atol=NEAR_M)
    for view in larger:
        sheet = near_region(view.depth, view.camera, SHEET, 0.005)
        assert sheet.sum() > 100
        assert view.after[sheet].mean() > 0.9
        around = near_region(view.depth, view.camera, SHEET, NEAR_M)
        assert not view.after[~around].any()
        assert not view.before.any()


@pytest.mark.parametrize("side", ["before", "after"])
def test_where_nothing_changed_a_site_stays_as_it_is(side: str) -> None:
    alone = replace(CORNER, side=side)
    (region,), larger = extended([alone], views(changed=False))
    np.testing.assert_array_equal((region.low, region.high), (alone.low, alone.high))
    assert not any(view.changed.any() for view in larger)


def test_light_that_changed_is_nothing_that_came() -> None:
    """It gets brighter from one side of the pictures to the other."""
    lit = []
    for view in views(changed=False):
        columns = np.arange(view.shown.shape[1], dtype=np.float32)[None, :, None]
        shown = view.shown / (1 + columns / columns.max())
        lit.append(replace(view, shown=shown))
    assert np.mean([np.abs(one.colors - one.shown).max(axis=2) > 0.1 for one in lit]) > 0.5
    (region,), larger = extended([CORNER], lit)
    np.testing.assert_array_equal((region.low, region.high), (CORNER.low, CORNER.high))
    assert not any(view.changed.any() for view in larger)


def test_colours_tell_nothing_of_what_is_gone() -> None:
    """Light that moved would take the floor away."""
    gone = replace(CORNER, side="before")
    (region,), larger = extended([gone], views(changed=True))
    np.testing.assert_array_equal((region.low, region.high), (gone.low, gone.high))
    assert not any(view.changed.any() for view in larger)


def test_views_and_masks_that_were_given_stay_as_they_were() -> None:
    given = views(changed=True)
    extended([CORNER], given)
    assert not any(view.changed.any() for view in given)
