"""Worlds with z up, from a recording whose world is turned."""

from dataclasses import replace

import numpy as np
import pytest
import turn
from scipy.spatial.transform import Rotation

from gslts.core.camera import at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import product, relative, transform
from gslts.datasets.dataset import Dataset, PointCloud
from gslts.trajectory.upright import describe_tilt, turn_upright

TILT = np.eye(4)
TILT[:3, :3] = Rotation.from_euler("xyz", (-82, 13, 40), degrees=True).as_matrix()
TILT[:3, 3] = 1, -2, 3


class Taken:
    """A frame of a data set, held in memory."""

    def __init__(self, frame: RgbdFrame, name: str) -> None:
        self.frame, self.name, self.camera = frame, name, frame.camera

    def read(self) -> RgbdFrame:
        return self.frame


def tilted(frames: list[RgbdFrame]) -> Dataset:
    """Return frames of a world with z up as a recording in another world."""
    turned = [
        replace(f, camera=at_pose(f.camera, product(TILT, f.camera.world_from_camera)))
        for f in frames
    ]
    points = PointCloud(transform(TILT, np.eye(3)), np.zeros((3, 3), np.uint8))
    taken = tuple(Taken(frame, str(number)) for number, frame in enumerate(turned))
    return Dataset("tilted", taken, points=points)


@pytest.fixture(scope="module")
def frames() -> list[RgbdFrame]:
    return turn.frames()[::3]


def test_a_tilt_is_described(frames: list[RgbdFrame]) -> None:
    level = [frame.camera for frame in frames]
    assert describe_tilt(level) == ""
    assert describe_tilt(level[:1]) == ""
    assert describe_tilt([]) == ""
    up = ", ".join(f"{number:.1f}" for number in TILT[:3, 2].round(1) + 0.0)
    found = describe_tilt([frame.camera for frame in tilted(frames).frames])
    assert found == f"z is not up here: up is ({up})"


def test_a_recording_is_turned_upright(frames: list[RgbdFrame]) -> None:
    pytest.importorskip("open3d")
    dataset = tilted(frames)
    turned = turn_upright(dataset)
    assert describe_tilt([frame.camera for frame in turned.frames]) == ""
    poses = [frame.camera.world_from_camera for frame in turned.frames]
    for pose, frame in zip(poses, frames, strict=True):
        true = frame.camera.world_from_camera
        # The heights of axes, and motions between frames, are those of the true world.
        np.testing.assert_allclose(pose[2, :3], true[2, :3], atol=np.deg2rad(0.5))
        expected = relative(frames[0].camera.world_from_camera, true)
        np.testing.assert_allclose(relative(poses[0], pose), expected, atol=1e-9)
    np.testing.assert_allclose(poses[0][:3, 3], 0, atol=1e-9)
    assert turned.points is not None
    in_first = transform(np.linalg.inv(poses[0]), turned.points.points)
    first = dataset.frames[0].camera.world_from_camera
    np.testing.assert_allclose(
        in_first, transform(np.linalg.inv(first), dataset.points.points), atol=1e-9
    )
    read = turned.frames[1].read()
    np.testing.assert_array_equal(read.camera.world_from_camera, poses[1])
    with pytest.raises(ValueError, match="tilted: there is no frame with a pose"):
        turn_upright(replace(dataset, frames=()))
