"""Launches the node of gslts, and RViz with rviz:=true."""

from pathlib import Path

import yaml
from ament_index_python.packages import get_package_share_directory
from gslts_ros.arguments import ARGUMENTS, command_line
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

SHARE = Path(get_package_share_directory("gslts_ros"))
STOP_S = "30"
"""Time that the node has for each step of its shutdown, s: it ends at the next safe point."""


def node(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Return the node with the options that the arguments make."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    text = Path(LaunchConfiguration("config").perform(context)).read_text(encoding="utf-8")
    return [
        Node(
            package="gslts_ros",
            executable="gslts_ros",
            name="gslts",
            namespace=LaunchConfiguration("namespace"),
            arguments=command_line(given, yaml.safe_load(text) or {}),
            parameters=[
                {"use_sim_time": LaunchConfiguration("use_sim_time").perform(context) == "true"}
            ],
            output="screen",
            sigterm_timeout=STOP_S,
            sigkill_timeout=STOP_S,
        )
    ]


def generate_launch_description() -> LaunchDescription:
    """Return the arguments with their descriptions, the node, and RViz."""
    own = [
        DeclareLaunchArgument(name, default_value="", description=description)
        for name, description in ARGUMENTS.items()
    ]
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", str(SHARE / "rviz/gslts.rviz")],
        condition=IfCondition(LaunchConfiguration("rviz")),
    )
    return LaunchDescription(
        [
            *own,
            DeclareLaunchArgument(
                "config",
                default_value=str(SHARE / "config/realsense.yaml"),
                description="YAML file with values of the arguments above; those given here win.",
            ),
            DeclareLaunchArgument(
                "namespace",
                default_value="",
                description="Namespace of the node and of its topics gslts/... and goal_pose.",
            ),
            DeclareLaunchArgument(
                "use_sim_time", default_value="false", description="true: the clock is /clock."
            ),
            DeclareLaunchArgument(
                "rviz",
                default_value="false",
                description="true: show map, changes and pose in RViz.",
            ),
            OpaqueFunction(function=node),
            rviz,
        ]
    )
