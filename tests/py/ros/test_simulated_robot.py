"""Messages of the simulated robot: decoders of recorded bags read them back."""

import math

import numpy as np
import pytest

from gslts.core.camera import camera_from_fov
from gslts.datasets.ros.images import camera_of, depth_of
from gslts_sim.ros.planar_pose import PlanarPose

messages = pytest.importorskip(
    "gslts_sim.ros.messages", reason="needs the messages of ROS: scripts/setup ros"
)
NOW_NS = 1_700_000_000_123_456_789


def test_depth_comes_back_in_millimetres() -> None:
    depth = np.array([[0, 1.2344, 65.535], [2.0006, 70.0, 0.4]], np.float32)
    message = messages.depth_image(depth, NOW_NS)
    assert (message.encoding, message.header.frame_id) == ("16UC1", messages.OPTICAL)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(NOW_NS, 10**9)
    expected = [[0, 1.234, 65.535], [2.001, 0, 0.4]]  # Depth out of range is no measurement.
    np.testing.assert_allclose(depth_of(message), expected, atol=1e-6)


def test_the_background_has_the_label_zero() -> None:
    message = messages.label_image(np.array([[-1, 0], [1, 299]], np.int32), NOW_NS)
    labels = np.asarray(message.data, np.uint8).view("<u2").reshape(2, 2)
    assert labels.tolist() == [[0, 1], [2, 300]]


@pytest.mark.parametrize("rectified", [True, False])
def test_intrinsics_come_back(rectified: bool) -> None:
    camera = camera_from_fov(64, 48, 1.2, np.eye(4))
    info = messages.camera_info(camera, NOW_NS)
    values, size, lens = camera_of(info, rectified)
    assert values == pytest.approx((camera.fx, camera.fy, camera.cx, camera.cy))
    assert (size, lens) == ((64, 48), None)


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, -2.5, math.pi])
def test_odometry_has_the_pose_that_a_goal_would_have(yaw_rad: float) -> None:
    pose = PlanarPose(1.5, -2.0, yaw_rad)
    message = messages.odometry(pose.matrix(), 0.5, -0.1, NOW_NS)
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
    assert (message.twist.twist.linear.x, message.twist.twist.angular.z) == (0.5, -0.1)
    read = messages.planar_pose(message.pose.pose)
    assert read.matrix() == pytest.approx(pose.matrix())


def test_a_goal_that_leans_has_the_heading_of_its_x_axis() -> None:
    message = messages.odometry(np.eye(4), 0.0, 0.0, NOW_NS).pose.pose
    turn = message.orientation  # 0.4 rad about x after 1 rad about z.
    turn.w, turn.x = math.cos(0.5) * math.cos(0.2), math.cos(0.5) * math.sin(0.2)
    turn.z, turn.y = math.sin(0.5) * math.cos(0.2), math.sin(0.5) * math.sin(0.2)
    assert messages.planar_pose(message).yaw_rad == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("field", "name", "value"),
    [
        ("position", "x", math.nan),
        ("position", "y", -math.inf),
        ("position", "x", 1e6),
        ("orientation", "w", 0.0),
        ("orientation", "z", math.nan),
    ],
)
def test_poses_that_are_none_are_rejected(field: str, name: str, value: float) -> None:
    message = messages.odometry(np.eye(4), 0.0, 0.0, NOW_NS).pose.pose
    setattr(getattr(message, field), name, value)
    with pytest.raises(ValueError, match="no pose in a home"):
        messages.planar_pose(message)
