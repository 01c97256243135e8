"""AI2-THOR (Kolve et al. 2017) as a robot of the project, in the project's coordinates."""

from gslts_sim.thor.event import ThorObject, camera_of, frame_of, instances_of, objects_of
from gslts_sim.thor.robot import ThorRobot, start_thor

__all__ = [
    "ThorObject",
    "ThorRobot",
    "camera_of",
    "frame_of",
    "instances_of",
    "objects_of",
    "start_thor",
]
