"""Homes with repeated views: a pose may be ambiguous or lost there, but never wrong."""

from dataclasses import replace

import change_room
import numpy as np
import pytest
import sim_scenes

from gslts.core.camera import at_pose
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import pose_distance
from gslts.localization.config import RelocalizationConfig
from gslts.localization.landmark_extraction import extract_landmarks
from gslts.localization.relocalizer import Localization, Relocalizer
from gslts_sim.explore import explore
from gslts_sim.home import Home, HomeObject
from gslts_sim.robot_body import Viewpoint

ELSEWHERE_M = 0.1
CORNERS = (0, 0, -0.2), (5, 4, 2.6)
"""Height of the walls of a room, which reach below its floor, m."""


def room(walls: HomeObject, floor: HomeObject, *objects: HomeObject) -> Home:
    walls = replace(walls, boxes=np.delete(walls.boxes, 4, axis=0))
    floor = replace(floor, receptacle=True)
    return replace(sim_scenes.simple_home(), objects=(walls, floor, *objects))


def tiled_room() -> Home:
    """Return a room whose texture repeats each half metre, with one red box."""
    walls = change_room.tiled("Wall|1", *CORNERS, 0, 40, inward=True, period=2)
    floor = change_room.tiled("Floor|1", (0, 0, -0.1), (5, 4, 0), 1, 90, period=2)
    block = change_room.tiled("Block|1", (2.0, 1.5, 0), (3.2, 2.3, 0.75), 2, 110, period=2)
    red = change_room.thing("Box|1", 2.2, 1.85, change_room.RED, "Block|1")
    return room(walls, floor, replace(block, receptacle=True, parent="Floor|1"), red)


def room_with_chairs() -> Home:
    """Return a room with plain walls and two equal chairs."""
    white, grey = (np.full((4, 4, 3), level, np.uint8) for level in (190, 120))
    walls = sim_scenes.box_object("Wall|1", *CORNERS, white, inward=True)
    floor = sim_scenes.box_object("Floor|1", (0, 0, -0.1), (5, 4, 0), grey)
    squares = np.random.default_rng(7).integers(30, 230, (12, 12, 3)).astype(np.uint8)
    cover = squares.repeat(16, 0).repeat(16, 1)
    chairs = [
        sim_scenes.box_object(f"Chair|{number}", (x - 0.3, 1.7, 0), (x + 0.3, 2.3, 0.9), cover)
        for number, x in ((1, 1.3), (2, 3.7))
    ]
    return room(walls, floor, *(replace(chair, parent="Floor|1") for chair in chairs))


def relocalizer_of(home: Home) -> Relocalizer:
    viewpoints = explore(home, 48)[0]
    gaussian_map: GaussianMap = change_room.map_of(home, viewpoints)[0]
    landmarks = extract_landmarks(
        gaussian_map, [change_room.see(home, viewpoint) for viewpoint in viewpoints[::2]], threads=1
    )
    return Relocalizer(gaussian_map, landmarks, RelocalizationConfig(threads=1))


def off_m(found: Localization, true: np.ndarray) -> float:
    assert found.world_from_camera is not None
    return pose_distance(found.world_from_camera, true)[0]


@pytest.mark.parametrize("make", [tiled_room, room_with_chairs])
def test_no_pose_is_confused_with_one_of_the_same_view(make) -> None:  # type: ignore[no-untyped-def]
    home = make()
    relocalizer = relocalizer_of(home)
    rng = np.random.default_rng(5)
    right = 0
    for seed in range(24):
        place = np.array([rng.uniform(0.6, 4.4), rng.choice([0.6, 3.4])])
        viewpoint = Viewpoint.at(place, float(rng.uniform(0, 360)), float(rng.uniform(-20, 40)))
        true = change_room.see(home, viewpoint).camera.world_from_camera
        frame = change_room.see(home, viewpoint, "kinect", seed)
        found = relocalizer.localize(replace(frame, camera=at_pose(frame.camera, np.eye(4))))
        if found.status == "ok":
            assert off_m(found, true) < ELSEWHERE_M, f"viewpoint {seed}"
            right += 1
    assert right >= 2, "views that differ are localized"
