"""Settings of the ROS 2 node."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from gslts.core.robot_body import RobotBody

Mount = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]
"""x y z, m, and roll pitch yaw, rad, as in URDF: about the fixed axes x, y and z."""


class Topics(BaseModel):
    """Names of the topics that the node receives.

    Attributes:
        rgb: Colour image; CompressedImage if the name ends with /compressed.
        depth: Depth image, registered to the colour image unless `depth_info` is given.
        camera_info: Intrinsics of the colour image; "" means camera_info beside `rgb`.
        depth_info: Intrinsics of a depth image that is not registered; "" if it is.
        odometry: nav_msgs/Odometry; "" for none.
        pose: geometry_msgs/PoseStamped; "" for none.
        labels: Instance image (16UC1, 0: no object), such as of a segmentation node; "" for none.
        label_names: std_msgs/String: JSON list with the type of each instance, from number 1.
        tilt: std_msgs/Float64MultiArray that tilts the camera; "" if it is fixed.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    rgb: str = "/camera/color/image_raw"
    depth: str = "/camera/aligned_depth_to_color/image_raw"
    camera_info: str = ""
    depth_info: str = ""
    odometry: str = ""
    pose: str = ""
    labels: str = ""
    label_names: str = ""
    tilt: str = ""

    @property
    def rgb_info(self) -> str:
        """Topic of the intrinsics of the colour image."""
        return self.camera_info or f"{_base(self.rgb).rpartition('/')[0]}/camera_info"

    @property
    def is_rectified(self) -> bool:
        """True if the colour images are rectified, which ROS says by the name of the topic."""
        return _base(self.rgb).rpartition("/")[2].startswith("image_rect")


class NodeConfig(BaseModel):
    """Settings of the node.

    Attributes:
        map_path: Folder of the map.
        topics: To receive.
        world: Frame of tf in which poses are wanted; used if no topic of poses is given.
        mount: Pose of the camera's optical frame in the frame that the poses are of; None if they
            are those of the camera, or tf knows it.
        locate: Localize frames in the map by their images; without, poses are those of the map.
        active: Drive the robot: collect views of changes, explore, go to objects.
        build: Build the map from what the robot sees if there is none.
        view: Show the map and the robot in the browser once there is a map.
        control: Let people who look at the map send the robot to objects; if `active`.
        record: Folder for a recording of the frames; None for none.
        rate_hz: Maximum number of frames per second that are compared with the map.
        max_viewpoints: Maximum number of viewpoints of a round.
        body: Size of the robot.
        threads: 0 uses all hardware threads.
        publish_tf: Publish the transform from `map` to the frame of the poses.
        ros_arguments: Arguments of ROS, such as --ros-args -p use_sim_time:=true.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    map_path: Path
    topics: Topics = Topics()
    world: str = "map"
    mount: Mount | None = None
    locate: bool = True
    active: bool = False
    build: bool = False
    view: bool = False
    control: bool = False
    record: Path | None = None
    rate_hz: Annotated[float, Field(gt=0, le=100)] = 4.0
    max_viewpoints: Annotated[int, Field(ge=1, le=1000)] = 100
    body: RobotBody = RobotBody()
    threads: Annotated[int, Field(ge=0)] = 0
    publish_tf: bool = False
    ros_arguments: tuple[str, ...] = ()


def parse_mount(text: str) -> Mount:
    """Parse the option --mount.

    Args:
        text: Six numbers, separated by commas.

    Raises:
        ValueError: These are not six finite numbers.
    """
    try:
        x, y, z, roll, pitch, yaw = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(
            f"--mount: expected six numbers x,y,z,roll,pitch,yaw, got {text!r}"
        ) from None
    if not all(abs(value) < 100 for value in (x, y, z, roll, pitch, yaw)):
        raise ValueError(f"--mount: expected metres and radians, got {text!r}")
    return x, y, z, roll, pitch, yaw


def _base(topic: str) -> str:
    return topic.removesuffix("/compressed").removesuffix("/compressedDepth")
