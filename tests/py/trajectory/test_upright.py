"""Worlds with z up, from a recording whose world is turned."""

from dataclasses import replace

import numpy as np
import pytest
import turn
from scipy.spatial.transform import Rotation

from gslts.core.camera import Camera, at_pose, camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import product, relative, transform
from gslts.datasets.dataset import Dataset, PointCloud
from gslts.trajectory.upright import describe_tilt, turn_upright, up_of

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


HOLDS = {"landscape": (0, 0), "left": (1, 1), "right": (3, 3), "mixed": (0, 1), "all": (0, 1, 3)}
"""Quarter turns of the camera about its axis, of successive frames."""


def turned_camera(frame: RgbdFrame, quarters: int) -> RgbdFrame:
    """Return the same view by a camera that is turned about its axis, clockwise as it sees."""
    for _ in range(quarters):
        c, turn_back = frame.camera, np.eye(4)
        turn_back[:2, :2] = [[0, -1], [1, 0]]
        rgb, depth = (np.ascontiguousarray(np.rot90(image)) for image in (frame.rgb, frame.depth))
        camera = Camera(
            fx=c.fy,
            fy=c.fx,
            cx=c.cy,
            cy=c.width - c.cx,
            width=c.height,
            height=c.width,
            world_from_camera=product(c.world_from_camera, turn_back),
        )
        frame = RgbdFrame(rgb, depth, camera)
    return frame


def held(frames: list[RgbdFrame], hold: str) -> list[RgbdFrame]:
    turns = HOLDS[hold]
    return [turned_camera(frame, turns[k % len(turns)]) for k, frame in enumerate(frames)]


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


@pytest.mark.parametrize("hold", HOLDS)
def test_cameras_may_be_held_in_portrait(frames: list[RgbdFrame], hold: str) -> None:
    level = held(frames, hold)
    poses = np.array([frame.camera.world_from_camera for frame in level])
    assert describe_tilt([frame.camera for frame in level]) == ""
    assert up_of(poses)[2] > np.cos(np.deg2rad(1))
    assert up_of(TILT @ poses) @ TILT[:3, 2] > np.cos(np.deg2rad(1))
    assert "z is not up here" in describe_tilt([f.camera for f in tilted(level).frames])


@pytest.mark.parametrize("quarters", [1, 3])
def test_level_cameras_in_portrait_are_held_as_phones(quarters: int) -> None:
    """Otherwise the left side of their images is up; a world with z up passes."""
    camera = camera_from_fov(64, 48, 1.2)
    angles = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    ahead = np.stack([np.cos(angles), np.sin(angles), np.zeros(20)], axis=1)
    turn_back = np.eye(4)
    turn_back[:3, :3] = Rotation.from_euler("z", 90 * quarters, degrees=True).as_matrix()
    poses = np.array([look_at(np.zeros(3), to, np.eye(3)[2]) @ turn_back for to in ahead])
    assert describe_tilt([at_pose(camera, pose) for pose in poses]) == ""
    up = up_of(poses)
    assert abs(up[2]) > np.cos(np.deg2rad(1))
    assert (poses[:, :3, 0] @ up < 0).all()


def test_views_in_a_single_direction_are_taken_for_landscape(frames: list[RgbdFrame]) -> None:
    pose = turned_camera(frames[0], 1).camera.world_from_camera
    np.testing.assert_allclose(up_of(np.array([pose, pose])), -pose[:3, 1], atol=1e-9)


@pytest.mark.parametrize("hold", HOLDS)
def test_a_recording_is_turned_upright(frames: list[RgbdFrame], hold: str) -> None:
    pytest.importorskip("open3d")
    frames = held(frames, hold)
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
