"""Views of changes: depth of added objects."""

from dataclasses import replace

import change_room
import numpy as np
from change_room import VIEWPOINTS, YELLOW

from gslts.rendering.losses import Exposure
from gslts.update.views import FRONT_M, View, bring_to_front


def added_box() -> View:
    """Return a view of a box that was added, with its depth rounded up to that of the block."""
    home = change_room.home()
    box = change_room.thing("Box|3", 2.6, 1.9, YELLOW, "Block|1")
    frame = change_room.see(replace(home, objects=(*home.objects, box)), VIEWPOINTS[0])
    old = change_room.see(home, VIEWPOINTS[0])
    after = np.abs(frame.depth - old.depth) > 1e-4
    rgb = old.rgb.astype(np.float32) / np.float32(255)
    return View(frame, Exposure(), old.depth, rgb, np.zeros_like(after), after)


def test_an_added_object_is_before_the_surface_that_it_occludes() -> None:
    view = added_box()
    behind = replace(view, frame=replace(view.frame, depth=view.rendered_depth + np.float32(0.02)))
    moved = bring_to_front(behind)
    before_m = (view.rendered_depth - moved.depth)[view.after]
    np.testing.assert_allclose(before_m, FRONT_M, atol=1e-6)
    np.testing.assert_array_equal(moved.depth[~view.after], behind.depth[~view.after])


def test_what_is_before_it_keeps_its_depth() -> None:
    view = added_box()
    far = (view.rendered_depth - view.depth)[view.after] > FRONT_M
    assert far.mean() > 0.9
    moved = bring_to_front(view)
    np.testing.assert_array_equal(moved.depth[view.after][far], view.depth[view.after][far])


def test_where_the_map_is_empty_depth_stays_as_measured() -> None:
    view = added_box()
    empty = replace(view, rendered_depth=np.zeros_like(view.rendered_depth))
    np.testing.assert_array_equal(bring_to_front(empty).depth, view.depth)
