"""Frames at the poses that a map gives them, one after the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gslts.core.camera import at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import pose_distance
from gslts.datasets.dataset import rigid
from gslts.localization.relocalizer import Localization, Relocalizer
from gslts.types import Floats

NEAR_M, NEAR_RAD = 0.10, np.deg2rad(5)
"""Tracking that ends farther from where it began may have lost its way: from 0.3 m off it has ended
7 cm beside the right place, and fitted there."""


class Localizer:
    """Puts the frames of a robot where the map says that they were taken.

    From one frame to the next its odometry is believed; where that does not lead, a frame is looked
    for from nothing.

    Args:
        relocalizer: Of the map as it is.
    """

    def __init__(self, relocalizer: Relocalizer) -> None:
        self._relocalizer = relocalizer
        self._world_from_odometry: Floats | None = None
        self._found_at: Floats | None = None

    @property
    def world_from_odometry(self) -> Floats | None:
        """[4,4] as the last frame that was found tells; None before the first one."""
        return self._world_from_odometry

    @property
    def found_at(self) -> Floats | None:
        """(3,) m, where the odometry had the last frame that was found; None before the first."""
        return self._found_at

    def publish(self, relocalizer: Relocalizer) -> None:
        """From the next frame on, looks in a new version of the map."""
        self._relocalizer = relocalizer

    def locate(self, frame: RgbdFrame) -> Localization:
        """Finds the next frame.

        Args:
            frame: Its pose is one of the odometry; frames of robots without one all have the same.
        """
        found = self._tracked(frame) or self._relocalizer.locate(frame)
        if found.status == "ok":
            assert found.world_from_camera is not None
            camera_from_odometry = np.linalg.inv(frame.camera.world_from_camera)
            self._world_from_odometry = found.world_from_camera @ camera_from_odometry
            self._found_at = frame.camera.world_from_camera[:3, 3]
        return found

    def located(self, frame: RgbdFrame) -> RgbdFrame:
        """The next frame where it was taken.

        If that is not certain, it is where the odometry leads, without depth and with a fault, so
        that nothing is concluded from it.

        Args:
            frame: As for `locate`.
        """
        found = self.locate(frame)
        placed = frame
        if self._world_from_odometry is not None:
            placed = in_world(frame, self._world_from_odometry)
        if found.status == "ok":
            return placed
        fault = f"{found.status}: {found.reason}"
        nothing = np.zeros((frame.camera.height, frame.camera.width), np.float32)
        return replace(placed, depth=nothing, depth_camera=None, fault=fault)

    def _tracked(self, frame: RgbdFrame) -> Localization | None:
        if self._world_from_odometry is None:
            return None
        expected = rigid(self._world_from_odometry @ frame.camera.world_from_camera)
        found = self._relocalizer.track(frame, expected)
        if found.status != "ok" or found.world_from_camera is None:
            return None
        metres, turn_rad = pose_distance(expected, found.world_from_camera)
        return found if metres < NEAR_M and turn_rad < NEAR_RAD else None


def in_world(frame: RgbdFrame, world_from_other: Floats) -> RgbdFrame:
    """A frame whose poses were those of another world.

    Args:
        frame: Of the other world.
        world_from_other: [4,4], rigid, m.
    """
    camera, depth_camera = (
        None if one is None else at_pose(one, rigid(world_from_other @ one.world_from_camera))
        for one in (frame.camera, frame.depth_camera)
    )
    assert camera is not None
    return replace(frame, camera=camera, depth_camera=depth_camera)
