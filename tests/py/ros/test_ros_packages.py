"""ROS packages: their launch arguments are the options of `gslts ros`, and their files fit."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import click
import pytest
import typer
import yaml

from gslts.cli import app

ROOT = Path(__file__).parents[3]
PACKAGE, MESSAGES = ROOT / "ros/gslts_ros", ROOT / "ros/gslts_msgs"
NOT_LAUNCHED = {"help", "ros_arguments"}
"""Parameters that are no arguments of the launch file."""


def module(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, PACKAGE / f"gslts_ros/{name}.py")
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


arguments, node = module("arguments"), module("node")


def command() -> click.Command:
    group = typer.main.get_command(app)
    assert hasattr(group, "commands")
    found: click.Command = group.commands["ros"]
    return found


def parsed(line: list[str]) -> dict[str, object]:
    """Return the parameters that the command makes of a line, without running it."""
    result: dict[str, object] = command().make_context("ros", list(line)).params
    return result


def test_arguments_of_the_launch_file_are_the_options_of_the_command() -> None:
    names = {
        option.lstrip("-").replace("-", "_")
        for parameter in command().params
        if parameter.name not in NOT_LAUNCHED
        for option in parameter.opts
    }
    assert set(arguments.ARGUMENTS) == names
    assert all(arguments.ARGUMENTS.values())
    flags = {parameter.name for parameter in command().params if getattr(parameter, "is_flag", 0)}
    assert {*arguments.SWITCHES, "locate"} == flags - NOT_LAUNCHED


def test_arguments_win_over_the_configuration() -> None:
    given = {"map": "/maps/flat 2", "active": "true", "depth": "", "locate": "false"}
    line = arguments.command_line(given, {"depth": "/d", "active": False, "rate": 2, "build": True})
    made = parsed(line)
    assert made["map_path"] == Path("/maps/flat 2")
    assert (made["depth"], made["rate"]) == ("/d", 2.0)
    assert (made["active"], made["build"], made["locate"]) == (True, True, False)


@pytest.mark.parametrize(
    ("given", "configured", "problem"),
    [
        ({}, {"mape": "x"}, "config: unknown mape; known: map, rgb"),
        ({"active": "yes"}, {}, "active: expected true or false, got 'yes'"),
        ({}, {"locate": "no"}, "locate: expected true or false, got 'no'"),
    ],
)
def test_wrong_arguments_are_named(
    given: dict[str, str], configured: dict[str, object], problem: str
) -> None:
    with pytest.raises(ValueError, match=problem):
        arguments.command_line(given, configured)


def test_the_configuration_of_the_package_is_one_of_the_command() -> None:
    for path in (PACKAGE / "config").glob("*.yaml"):
        configured = yaml.safe_load(path.read_text())
        made = parsed(["--map", "m", *arguments.command_line({}, configured)])
        assert made["rgb"] == configured["rgb"]


def test_arguments_of_ros_are_kept_apart() -> None:
    of_ros = ["--ros-args", "-r", "__ns:=/robot1", "-p", "use_sim_time:=true"]
    command_name, *line = node.arguments_of(["--map", "m", *of_ros])
    assert command_name == "ros"
    made = parsed(line)
    assert list(made["ros_arguments"]) == of_ros
    assert not parsed(node.arguments_of(["--map", "m"])[1:])["ros_arguments"]


def test_rviz_shows_topics_that_the_node_has() -> None:
    config = yaml.safe_load((PACKAGE / "rviz/gslts.rviz").read_text())["Visualization Manager"]
    shown = {
        item["Topic"]["Value"]
        for item in [*config["Displays"], *config["Tools"]]
        if "Topic" in item
    }
    folder = ROOT / "python/gslts/ros"
    source = "".join((folder / f"{name}.py").read_text() for name in ("goals", "publishing"))
    own = {f"/{name}" for name in re.findall(r'"(gslts/\w+|goal_pose)"', source)}
    camera = yaml.safe_load((PACKAGE / "config/realsense.yaml").read_text())["rgb"]
    assert shown <= own | {camera}
    assert {"/gslts/changes", "/gslts/grid", "/gslts/pose"} <= shown


def test_packages_have_the_version_of_the_project() -> None:
    match = re.search(r"project\(gslts VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text())
    assert match is not None
    for folder in (PACKAGE, MESSAGES):
        root = ElementTree.parse(folder / "package.xml").getroot()
        assert (root.findtext("name"), root.findtext("version")) == (folder.name, match[1])
    assert f'version="{match[1]}"' in (PACKAGE / "setup.py").read_text()


def test_interfaces_can_be_parsed() -> None:
    parser = pytest.importorskip(
        "rosidl_adapter.parser", reason="needs the packages of ROS: scripts/setup ros"
    )
    message = parser.parse_message_file("gslts_msgs", MESSAGES / "msg/FoundObject.msg")
    assert [field.name for field in message.fields] == ["center", "size", "score"]
    query = parser.parse_service_file("gslts_msgs", MESSAGES / "srv/Query.srv")
    assert [field.name for field in query.request.fields] == ["words"]
    assert [str(field.type) for field in query.response.fields][-1] == "gslts_msgs/FoundObject[]"
    go = parser.parse_action_file("gslts_msgs", MESSAGES / "action/GoTo.action")
    assert [field.name for field in go.feedback.fields] == ["activity"]
    listed = re.findall(r'"(\w+/\w+\.\w+)"', (MESSAGES / "CMakeLists.txt").read_text())
    found = [path for kind in ("action", "msg", "srv") for path in (MESSAGES / kind).iterdir()]
    assert sorted(listed) == sorted(str(path.relative_to(MESSAGES)) for path in found)
