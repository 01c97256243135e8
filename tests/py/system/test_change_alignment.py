"""Alignment of frames before the comparison, whatever the size of their images."""

from dataclasses import replace

import change_room
import numpy as np
import pytest
from change_room import VIEWPOINTS

from gslts.change.detector import ChangeDetector
from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import se3_retract
from gslts_sim.controller import Controller


def enlarged(frame: RgbdFrame, factor: int) -> RgbdFrame:
    """Return a frame of larger images, which are those of the frame once they are halved."""
    camera = frame.camera
    return RgbdFrame(
        frame.rgb.repeat(factor, axis=0).repeat(factor, axis=1),
        frame.depth.repeat(factor, axis=0).repeat(factor, axis=1),
        Camera(
            fx=factor * camera.fx,
            fy=factor * camera.fy,
            cx=factor * camera.cx,
            cy=factor * camera.cy,
            width=factor * camera.width,
            height=factor * camera.height,
            world_from_camera=camera.world_from_camera,
        ),
    )


@pytest.mark.parametrize("factor", [2, 4])
def test_larger_frames_are_aligned_as_well(factor: int) -> None:
    gaussian_map, cameras = change_room.mapped()
    detector = ChangeDetector(gaussian_map, cameras=cameras.values())
    robot = Controller(change_room.home(), width=320, height=240, noise="none")
    robot.go(VIEWPOINTS[0])
    frame = robot.observe()
    turned = se3_retract(frame.camera.world_from_camera, np.array([0.03, -0.04, 0, 0, 0.07, 0]))
    frame = replace(frame, camera=at_pose(frame.camera, turned))
    poses = [
        detector.detect(each).camera.world_from_camera for each in (frame, enlarged(frame, factor))
    ]
    assert not np.array_equal(poses[0], turned)
    assert np.array_equal(poses[0], poses[1])
