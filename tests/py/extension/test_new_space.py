"""Comparison of frames with what a map knows."""

from dataclasses import replace
from functools import cache

import numpy as np
from change_room import VIEWPOINTS, YELLOW, home, mapped, see, thing

from gslts.change.visibility import Visibility
from gslts.extension.new_space import KnownSpace
from gslts_sim.robot_body import Viewpoint


@cache
def known() -> KnownSpace:
    gaussian_map, cameras = mapped()
    return KnownSpace(gaussian_map, Visibility(gaussian_map, cameras.values(), 1), 1)


@cache
def half_known() -> KnownSpace:
    """A map without the part at x above 2.6 m, and without the cameras that looked there."""
    gaussian_map, cameras = mapped()
    near = [c for c in cameras.values() if (c.world_from_camera[:3] @ [0, 0, 1.5, 1])[0] < 2]
    return KnownSpace(
        gaussian_map.select(gaussian_map.means[:, 0] < 2.6),
        Visibility(gaussian_map.select(gaussian_map.means[:, 0] < 2.6), near, 1),
        1,
    )


def test_known_room_is_neither_new_nor_changed() -> None:
    for viewpoint in VIEWPOINTS:
        space = known().compare(see(home(), viewpoint))
        assert space.new.mean() < 0.02
        assert space.changed.mean() < 0.02


def test_added_object_in_known_space_is_changed() -> None:
    box = thing("Box|3", 2.6, 1.7, YELLOW, "Block|1")
    changed = replace(home(), objects=(*home().objects, box))
    frame, before = see(changed, VIEWPOINTS[0]), see(home(), VIEWPOINTS[0])
    object_px = np.abs(frame.depth - before.depth) > 0.02
    space = known().compare(frame)
    assert space.changed[object_px].mean() > 0.5  # A cell of the grid is decided by its middle.
    assert space.new[object_px].mean() < 0.1
    assert space.changed[~object_px].mean() < 0.06


def test_removed_half_is_new() -> None:
    viewpoint = Viewpoint(2.0, 2.8, 0.0, 20.0)
    frame = see(home(), viewpoint)
    space = half_known().compare(frame)
    x, y, z = frame.camera.world_from_camera[:3, 2]
    assert abs(x) > max(abs(y), abs(z))  # It faces along x.
    assert space.new.mean() > 0.5
    assert space.changed.mean() < 0.05


def test_without_depth_only_empty_pixels_are_new() -> None:
    frame = see(home(), VIEWPOINTS[0])
    blind = replace(frame, depth=np.zeros_like(frame.depth))
    assert known().compare(blind).new.mean() < 0.02
    assert not known().compare(blind).changed.any()


def test_number_of_threads_does_not_matter() -> None:
    gaussian_map, cameras = mapped()
    frame = see(home(), VIEWPOINTS[1])
    spaces = [
        KnownSpace(gaussian_map, Visibility(gaussian_map, cameras.values(), n), n).compare(frame)
        for n in (1, 2)
    ]
    for name in ("new", "poor", "changed"):
        assert np.array_equal(getattr(spaces[0], name), getattr(spaces[1], name))
