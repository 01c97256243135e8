"""Localizes a sequence of frames in a map by tracking, and by relocalization where that fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gslts.core.camera import at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import pose_distance
from gslts.datasets.dataset import rigid
from gslts.localization.constants import TRACKING_M, TRACKING_RAD
from gslts.localization.relocalizer import Localization, Relocalizer
from gslts.types import Floats


class Localizer:
    """Corrects the drift of a robot's odometry frame by frame.

    Between frames the odometry predicts the pose, which is refined by tracking; where that fails,
    the frame is localized without a prior.

    Args:
        relocalizer: Relocalizer in the current version of the map.
    """

    def __init__(self, relocalizer: Relocalizer) -> None:
        self._relocalizer = relocalizer
        self._world_from_odometry: Floats | None = None
        self._found_at: Floats | None = None

    @property
    def world_from_odometry(self) -> Floats | None:
        """[4,4] correction by the last localized frame, m; None before the first one."""
        return self._world_from_odometry

    @property
    def found_at(self) -> Floats | None:
        """(3,) position of the last localized frame in the odometry, m; None before the first."""
        return self._found_at

    def publish(self, relocalizer: Relocalizer) -> None:
        """Use a new version of the map from the next frame on.

        Args:
            relocalizer: Relocalizer in the new version.
        """
        self._relocalizer = relocalizer

    def localize(self, frame: RgbdFrame) -> Localization:
        """Localize the next frame.

        Args:
            frame: Its pose is that of the odometry; without odometry, all frames have the same.
        """
        found = self._track(frame) or self._relocalizer.localize(frame)
        if found.status == "ok":
            assert found.world_from_camera is not None
            camera_from_odometry = np.linalg.inv(frame.camera.world_from_camera)
            self._world_from_odometry = found.world_from_camera @ camera_from_odometry
            self._found_at = frame.camera.world_from_camera[:3, 3]
        return found

    def localize_frame(self, frame: RgbdFrame) -> RgbdFrame:
        """Return the next frame at its pose in the map.

        Args:
            frame: As for `localize`.

        Returns:
            The frame at its localized pose. If it is lost or ambiguous, it is at the predicted
            pose and has a fault, so that nothing is concluded from it.
        """
        return self.placed(frame, self.localize(frame))

    def placed(self, frame: RgbdFrame, found: Localization) -> RgbdFrame:
        """Return the frame that was localized last at its pose in the map; see `localize_frame`.

        Args:
            frame: As for `localize`.
            found: Its localization.
        """
        placed = frame
        if self._world_from_odometry is not None:
            placed = in_world(frame, self._world_from_odometry)
        if found.status == "ok":
            return placed
        return replace(placed, fault=f"{found.status}: {found.reason}")

    def _track(self, frame: RgbdFrame) -> Localization | None:
        """Refine the predicted pose; None without a prediction, or if that fails."""
        if self._world_from_odometry is None:
            return None
        expected = rigid(self._world_from_odometry @ frame.camera.world_from_camera)
        found = self._relocalizer.track(frame, expected)
        if found.status != "ok" or found.world_from_camera is None:
            return None
        metres, turn_rad = pose_distance(expected, found.world_from_camera)
        return found if metres < TRACKING_M and turn_rad < TRACKING_RAD else None


def in_world(frame: RgbdFrame, world_from_other: Floats) -> RgbdFrame:
    """Transform the poses of a frame into another world frame.

    Args:
        frame: In the other world.
        world_from_other: [4,4] rigid, m.
    """
    camera, depth_camera = (
        None
        if camera is None
        else at_pose(camera, rigid(world_from_other @ camera.world_from_camera))
        for camera in (frame.camera, frame.depth_camera)
    )
    assert camera is not None
    return replace(frame, camera=camera, depth_camera=depth_camera)
