"""Arguments of the launch file, and the command line of the node that they make."""

from collections.abc import Mapping

ARGUMENTS = {
    "map": "Folder of the map; made with build:=true if there is none.",
    "rgb": "Topic of the colour image; its name ends with /compressed for CompressedImage.",
    "depth": "Topic of the depth image, registered to the colour image unless depth_info is given.",
    "camera_info": "Topic of the intrinsics of the colour image; default: camera_info beside rgb.",
    "depth_info": "Topic of the intrinsics of a depth image that is not registered.",
    "odometry": "Topic of poses: nav_msgs/Odometry. Without odometry and pose: tf.",
    "pose": "Topic of poses: geometry_msgs/PoseStamped.",
    "mount": "Pose of the optical frame in that of the poses, x,y,z,roll,pitch,yaw, m and rad.",
    "world": "Frame of tf for the poses; default: odom, or map with locate:=false.",
    "locate": "true: localize images in the map; false: the poses are those of the map.",
    "labels": "Topic of instance images (16UC1) of a segmentation node.",
    "label_names": "Topic of the types of the instances: std_msgs/String, a JSON list.",
    "active": "true: drive the robot by /goal_pose, to changes and to objects.",
    "tilt": "Topic that tilts the camera: std_msgs/Float64MultiArray, rad below the horizon.",
    "build": "true: build the map from what the robot sees if there is none.",
    "record": "Folder for a recording of the frames, for gslts map.",
    "rate": "Maximum number of frames per second that are compared with the map.",
    "view": "true: also show the map and the robot in the browser.",
    "control": "true: with view and active, whoever looks can send the robot to an object.",
    "publish_tf": "true: publish map -> odom on /tf, if no other localization of the robot does.",
    "viewpoints": "Maximum number of viewpoints of a round.",
    "radius": "Radius of the robot, m.",
    "height": "Height of the robot, m.",
    "step": "Maximum height that the robot drives over, m.",
    "threads": "Number of threads; 0 uses all.",
}
"""Options of `gslts ros` by name, with `_` for `-`; empty ones keep the default of the node."""
SWITCHES = ("active", "build", "view", "control", "publish_tf")
"""Options that are given or not."""


def command_line(given: Mapping[str, str], configured: Mapping[str, object]) -> list[str]:
    """Return the arguments of `gslts ros`.

    Args:
        given: Values of arguments of the launch file; "" if one is not given.
        configured: Values of the configuration file, which hold where none is given.

    Raises:
        ValueError: A name of the configuration is unknown, or a switch is neither true nor false.
    """
    unknown = sorted(set(configured) - set(ARGUMENTS))
    if unknown:
        raise ValueError(f"config: unknown {', '.join(unknown)}; known: {', '.join(ARGUMENTS)}")
    line = []
    for name in ARGUMENTS:
        value = given.get(name, "") or _text(configured.get(name))
        option = f"--{name.replace('_', '-')}"
        if value == "":
            continue
        if name in SWITCHES or name == "locate":
            if value not in ("true", "false"):
                raise ValueError(f"{name}: expected true or false, got {value!r}")
            if name == "locate" and value == "false":
                option = "--no-locate"
            if value == "true" or name == "locate":
                line.append(option)
        else:
            line += [option, value]
    return line


def _text(value: object) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)
