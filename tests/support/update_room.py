"""Changes of the room of `change_room`, the views a robot collects, and updates of its map."""

from dataclasses import replace
from functools import cache
from typing import Literal

import change_room
import numpy as np
from change_room import BLUE, SIZE, VIEWPOINTS, YELLOW

from gslts.change.changes import Change
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot
from gslts.keeper.config import KeeperConfig
from gslts.update.config import CollectConfig, EditConfig, RefineConfig, UpdateConfig
from gslts.update.integrate import UpdateResult, integrate_changes
from gslts.update.view_collection import Collection, collect_views
from gslts_sim.changes import shift
from gslts_sim.controller import Controller
from gslts_sim.home import Home, HomeObject
from gslts_sim.robot_body import Viewpoint

Kind = Literal["removal", "addition", "relocation", "shift"]
COLLECT = CollectConfig(distance_m=1.0)
SMALL = EditConfig(voxel_m=0.02)
"""Images of 160 px do not resolve more."""
UPDATE = UpdateConfig(
    collect=COLLECT, edit=SMALL, refine=RefineConfig(iterations=60, margin_px=15), threads=1
)
LOOP = KeeperConfig(
    max_viewpoints=8,
    detection=change_room.CONFIG,
    update=UpdateConfig(
        collect=COLLECT,
        edit=SMALL,
        refine=RefineConfig(iterations=30, margin_px=15),
        threads=1,
    ),
)
REMOVED = (np.array([2.08, 1.73, 0.75]), np.array([2.32, 1.97, 1.05]))
"""Corners of the red box that is removed."""
ADDED = (np.array([2.48, 1.58, 0.75]), np.array([2.72, 1.82, 1.05]))
"""Corners of the yellow box that is added."""


def yellow() -> HomeObject:
    """Return a yellow box on the block."""
    return change_room.thing("Box|3", 2.6, 1.7, YELLOW, "Block|1")


def changed_home(kind: Kind) -> Home:
    """Return the room after a change."""
    home = change_room.home()
    if kind == "removal":
        return home.without(["Box|1"])
    if kind == "addition":
        return replace(home, objects=(*home.objects, yellow()))
    if kind == "shift":
        return shift(home, "Block|1", 0.1, 0.0, 2.0)
    moved = replace(change_room.thing("Box|2", 2.6, 1.7, BLUE, "Block|1"))
    return replace(home.without(["Box|2"]), objects=(*home.without(["Box|2"]).objects, moved))


def robot_in(home: Home, noise: str = "none") -> Controller:
    """Return a robot that faces the block."""
    robot = Controller(home, **SIZE, noise=noise)
    robot.go(VIEWPOINTS[0])
    return robot


@cache
def detected(kind: Kind) -> Change:
    """Return the change that the first frame shows."""
    changes = change_room.detector().detect(robot_in(changed_home(kind)).observe()).changes
    return next(change for change in changes if change.kind == kind)


@cache
def collected(kind: Kind) -> Collection:
    """Return the views that a robot collects around the change; made once per process."""
    found = collect_views(
        robot_in(changed_home(kind)), change_room.detector(), [detected(kind)], COLLECT
    )
    assert found.changes == (detected(kind),)
    return found


def opaque_in(
    gaussian_map: GaussianMap, box: tuple[np.ndarray, np.ndarray], margin_m: float
) -> int:
    """Return the number of visible Gaussians with their centres in a box without its margin."""
    low, high = box[0] + margin_m, box[1] - margin_m
    inside = ((gaussian_map.means > low) & (gaussian_map.means < high)).all(axis=1)
    return int((inside & (gaussian_map.logit_opacities > np.log(0.05 / 0.95))).sum())


class Changing:
    """A robot in a home that changes after some frames."""

    def __init__(self, first: Home, then: Home, frames: int) -> None:
        self._robots, self._left = [robot_in(home) for home in (first, then)], frames

    def observe(self) -> RgbdFrame:
        self._left -= 1
        return self._robots[0 if self._left >= 0 else 1].observe()

    def pose(self) -> np.ndarray:
        return self._robots[0].pose()

    def reachable_positions(self) -> np.ndarray:
        return self._robots[0].reachable_positions()

    def move_towards(
        self, position: np.ndarray, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        first, second = self._robots
        arrived = first.move_towards(position, yaw_rad, pitch_rad)
        return second.move_towards(position, yaw_rad, pitch_rad) and arrived


def run_update(robot: Robot, kind: str = "removal", change: Change | None = None) -> UpdateResult:
    """Update the map of the room for a change, by default the one that is detected first."""
    return run_updates(robot, [change or detected(kind)])


def run_updates(robot: Robot, changes: list[Change]) -> UpdateResult:
    """Update the map of the room for several changes."""
    gaussian_map, cameras = change_room.mapped()
    return integrate_changes(
        gaussian_map,
        list(cameras.values()),
        changes,
        robot,
        UPDATE,
        detector=change_room.detector(),
    )


def viewpoints_of_the_change() -> list[Viewpoint]:
    """Return viewpoints that confirm the change by several frames, then others all around."""
    found = collected("removal")
    viewpoints = []
    for view in (*found.views[:1] * 4, *found.views):
        pose = view.camera.world_from_camera
        x, y, z = pose[:3, 2]
        viewpoints.append(
            Viewpoint.at(
                np.round(pose[:2, 3] / 0.25) * 0.25,
                float(np.rad2deg(np.arctan2(y, x))),
                float(np.rad2deg(np.arcsin(-z))),
            )
        )
    return viewpoints
