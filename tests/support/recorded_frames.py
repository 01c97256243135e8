"""Frames that a robot sees in a small room."""

import sim_scenes

from gslts_sim.controller import Controller
from gslts_sim.robot_body import Viewpoint

VIEWPOINTS = [Viewpoint(1.0, y, yaw, 30.0) for y, yaw in ((1.0, 0.0), (1.0, 45.0), (2.5, 330.0))]


def frames_of_robot(width: int = 64, height: int = 48) -> list:
    """Return the frames that a robot sees at `VIEWPOINTS`."""
    robot = Controller(sim_scenes.simple_home(), width=width, height=height)
    frames = []
    for viewpoint in VIEWPOINTS:
        x, y = viewpoint.x, viewpoint.y
        robot.act(
            "Teleport",
            position={"x": x, "y": y},
            rotation=viewpoint.yaw_deg,
            horizon=viewpoint.horizon_deg,
        )
        frames.append(robot.observe())
    return frames
