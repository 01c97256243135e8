"""A turn of the camera on the spot: the last frame shows what the first one did."""

from pathlib import Path

import change_room
import sim_scenes

from gslts.core.frame import RgbdFrame
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint

VIEWPOINTS = [Viewpoint(1.0, 1.0, yaw, 15.0) for yaw in range(0, 360, 12)]


def frames() -> list[RgbdFrame]:
    """Return the frames, without noise."""
    return [_see(_robot(change_room.home()), viewpoint) for viewpoint in VIEWPOINTS]


def frame_elsewhere() -> RgbdFrame:
    """Return a frame of another home."""
    return _see(_robot(sim_scenes.simple_home()), Viewpoint(1.0, 1.0, 30.0, 10.0))


def recording(folder: Path) -> Path:
    """Write the frames as a data set."""
    capture(_robot(change_room.home()), VIEWPOINTS, folder)
    return folder


def _robot(home: Home) -> Controller:
    return Controller(home, width=320, height=240, noise="none")


def _see(robot: Controller, viewpoint: Viewpoint) -> RgbdFrame:
    robot.go(viewpoint)
    return robot.observe()
