"""Command `gslts sim ros`: the simulated robot as a ROS 2 node."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts_sim.cli.arguments import Height, Noise, Seed, Source, Width

if TYPE_CHECKING:
    from gslts_sim.day import Day
    from gslts_sim.home import Home


def ros(
    source: Source,
    seed: Seed = 0,
    rate: Annotated[
        float, typer.Option(min=0.1, max=60, help="Maximum number of frames per second.")
    ] = 5.0,
    width: Width = 640,
    height: Height = 480,
    noise: Noise = "kinect",
    visit: Annotated[
        int, typer.Option("--seed", min=0, help="Seed of the noise and of the drift.")
    ] = 0,
    drift: Annotated[
        float, typer.Option(min=0, max=10, help="Factor of the errors of odometry; 0 for none.")
    ] = 1.0,
    speed: Annotated[
        float, typer.Option(min=0.1, max=10, help="Factor of the speeds of 0.5 m/s and 1 rad/s.")
    ] = 1.0,
    day: Annotated[
        Path | None, typer.Option(help="Changes of the home, written by gslts sim day.")
    ] = None,
    changes: Annotated[
        int, typer.Option(min=0, help="Without --day: number of changes, made from SEED.")
    ] = 6,
    interval: Annotated[
        float | None,
        typer.Option(min=1, help="Seconds between changes; without, they happen on request only."),
    ] = None,
) -> None:
    """Publish a simulated robot on ROS 2, and obey goals, until Ctrl-C or SIGTERM.

    It publishes /camera/color/image_raw and camera_info, /camera/aligned_depth_to_color/image_raw,
    /camera/pose, /odom and /tf, and follows /goal_pose (in the frame odom) and
    /tilt_controller/commands. The service /robot/change lets the next change of the home happen,
    and /robot/carry_away puts the robot down elsewhere without odometry noticing.

    Example: gslts sim ros living_room 3 --rate 5 --changes 6
    """
    from gslts.cli.run import stop_signals

    with stop_signals() as received:
        # Inside, as these take a second.
        from gslts_sim.actions import SceneState
        from gslts_sim.ros.node import spin
        from gslts_sim.ros.robot import SimulatedRobot
        from gslts_sim.ros.scripted_home import ScriptedHome
        from gslts_sim.sensor import Sensor

        sensor = Sensor(noise, visit)
        script, home = _open(source, seed, day, changes)
        state = SceneState(home) if script is None else script.state(home, 0)
        events = [] if script is None else [event for events in script.rounds for event in events]
        scripted = ScriptedHome(state, events, sensor)
        robot = SimulatedRobot(scripted, sensor, (width, height), visit, drift, speed)
        typer.echo(f"robot in {home.name}: {len(events)} changes to come; Ctrl-C ends it")
        spin(robot, rate, interval, lambda: bool(received))


def _open(source: str, seed: int, day: Path | None, changes: int) -> tuple[Day | None, Home]:
    """Open a home, with the day that is given or made."""
    from gslts_sim.change_sampler import TaskSettings
    from gslts_sim.day import make_day, read_day
    from gslts_sim.home_source import HomeSource, file_digest, open_home
    from gslts_sim.tasks import homes_of

    if day is None and changes == 0:
        return None, open_home(source, seed)
    if day is None:
        folder = Path.cwd()
        origin, template = next(homes_of([source], folder, seed))
        script = make_day(origin, template, TaskSettings(), seed, changes)
        return script, script.home.load(folder)
    script = read_day(day)
    if isinstance(script.home, HomeSource):
        given, expected = f"{source} {seed}", f"{script.home.room_type} {script.home.seed}"
        is_same = given == expected
    else:
        given, expected = source, script.home.file
        is_same = Path(source).is_file() and file_digest(Path(source)) == script.home.sha256
    if not is_same:
        raise ValueError(f"{day} is a day of {expected}, not of {given}")
    return script, script.home.load(day.parent)
