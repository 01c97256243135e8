"""The command `gslts ros`."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Annotated

import typer

from gslts.cli.arguments import Control, require_view
from gslts.cli.mapping import Threads
from gslts.cli.navigation import Height, Radius, Step

# Imports are inside the command, so that `gslts --help` starts fast.


def ros(
    map_path: Annotated[Path, typer.Option("--map", metavar="MAP", help="Folder of the map.")],
    rgb: Annotated[
        str, typer.Option(metavar="TOPIC", help="Colour image, raw or compressed.")
    ] = "/camera/color/image_raw",
    depth: Annotated[
        str, typer.Option(metavar="TOPIC", help="Depth image, 16UC1 or 32FC1, or compressedDepth.")
    ] = "/camera/aligned_depth_to_color/image_raw",
    camera_info: Annotated[
        str,
        typer.Option(metavar="TOPIC", help="Intrinsics. Default: camera_info beside --rgb."),
    ] = "",
    depth_info: Annotated[
        str,
        typer.Option(metavar="TOPIC", help="Intrinsics of depth that is not registered."),
    ] = "",
    odometry: Annotated[str, typer.Option(metavar="TOPIC", help="Poses: nav_msgs/Odometry.")] = "",
    pose: Annotated[
        str, typer.Option(metavar="TOPIC", help="Poses: geometry_msgs/PoseStamped.")
    ] = "",
    mount: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z,ROLL,PITCH,YAW",
            help="Pose of the optical frame in the frame of the poses, m and rad; without tf.",
        ),
    ] = None,
    world: Annotated[
        str | None,
        typer.Option(
            metavar="FRAME", help="Frame of tf for the poses. Default: odom, or map if --no-locate."
        ),
    ] = None,
    locate: Annotated[
        bool,
        typer.Option(
            help="Localize the images in the map; --no-locate: the poses are those of the map."
        ),
    ] = True,
    labels: Annotated[
        str,
        typer.Option(metavar="TOPIC", help="Object instances, 16UC1: of a segmentation node."),
    ] = "",
    label_names: Annotated[
        str,
        typer.Option(metavar="TOPIC", help="Types of the instances: std_msgs/String, JSON list."),
    ] = "",
    active: Annotated[
        bool,
        typer.Option("--active", help="Drive the robot by /goal_pose: to changes and objects."),
    ] = False,
    tilt: Annotated[
        str,
        typer.Option(
            metavar="TOPIC", help="Float64MultiArray: angle of the camera downwards, rad."
        ),
    ] = "",
    build: Annotated[
        bool,
        typer.Option("--build", help="Build the map from what the robot sees if there is none."),
    ] = False,
    record: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Record frames, for gslts map.")
    ] = None,
    rate: Annotated[
        float, typer.Option(min=0.1, max=100, help="Maximum frames per second to be compared.")
    ] = 4.0,
    viewpoints: Annotated[
        int, typer.Option(min=1, max=1000, help="Maximum number of viewpoints of a round.")
    ] = 100,
    view: Annotated[
        bool,
        typer.Option("--view", help="Also show the map and the robot in the browser."),
    ] = False,
    control: Control = False,
    publish_tf: Annotated[
        bool,
        typer.Option(
            "--publish-tf",
            help="Publish map -> odom on /tf, if no other localization of the robot does.",
        ),
    ] = False,
    radius: Radius = 0.2,
    height: Height = 1.2,
    step: Step = 0.02,
    threads: Threads = 0,
    ros_arguments: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[-- --ros-args ...]",
            help="Arguments of ROS: -r __ns:=/robot1, -p use_sim_time:=true, -r FROM:=TO.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Keep a map up to date on a robot with ROS 2, as the node gslts.

    It receives the images and the poses of the robot, detects changes, and updates the map with
    what the robot sees on its way; with --active, it also drives: around changes, and to objects.
    Words on /gslts/query and /gslts/go are answered on /gslts/answer; /gslts/command takes build,
    explore, extend, round and consolidate. Ctrl-C or SIGTERM ends it at the next safe point.

    Example: gslts ros --map out/map --build --odometry /odom --mount 0.1,0,0.9,-1.92,0,-1.57
    """
    require_view(view, control)
    if control and not active:
        raise ValueError("--control: the node may not drive the robot; give --active as well")

    from gslts.cli.run import stop_signals
    from gslts.core.robot_body import RobotBody
    from gslts.ros.config import NodeConfig, Topics, parse_mount
    from gslts.ros.node import run_node

    topics = Topics(
        rgb=rgb,
        depth=depth,
        camera_info=camera_info,
        depth_info=depth_info,
        odometry=odometry,
        pose=pose,
        labels=labels,
        label_names=label_names,
        tilt=tilt,
    )
    if odometry and pose:
        raise ValueError("give either --odometry or --pose")
    if publish_tf and not locate:
        raise ValueError("--publish-tf: with --no-locate, the poses are in the map already")
    config = NodeConfig(
        map_path=map_path,
        topics=topics,
        world=world or ("odom" if locate else "map"),
        mount=None if mount is None else parse_mount(mount),
        locate=locate,
        active=active,
        build=build,
        view=view,
        control=control,
        record=record,
        rate_hz=rate,
        max_viewpoints=viewpoints,
        body=RobotBody(radius_m=radius, height_m=height, step_m=step),
        threads=threads,
        publish_tf=publish_tf,
        ros_arguments=tuple(ros_arguments or ()),
    )
    stop = threading.Event()
    with stop_signals(stop.set):
        run_node(config, stop)
