"""The command `gslts bench ros`."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated

import typer

# Imports are inside the command, so that `gslts --help` starts fast.


def ros(
    out: Annotated[Path, typer.Option(help="New folder: map, recording, bag, logs, plan.")],
    room: Annotated[str, typer.Option(help="Room type.")] = "living_room",
    seed: Annotated[int, typer.Option(min=0, help="Of the home.")] = 3,
    changes: Annotated[int, typer.Option(min=1, help="Number of changes.")] = 6,
    per_round: Annotated[int, typer.Option(min=1, help="Changes before each round.")] = 2,
    viewpoints: Annotated[int, typer.Option(min=1, help="Maximum number in a round.")] = 12,
    width: Annotated[int, typer.Option(min=160, max=4096, help="Of the images, px.")] = 640,
    speed: Annotated[
        float, typer.Option(min=0.1, max=10, help="Factor of the speeds of the robot.")
    ] = 1.0,
) -> None:
    """Let a simulated robot live a day over ROS 2: map a room, find changes, go to an object.

    Robot and node are processes of their own, which hear nobody else. It needs rclpy: source ROS,
    or use build/ros/bin/gslts, which scripts/setup ros makes.

    Example: gslts bench ros --out out/ros_day
    """
    # In a domain of their own, on this machine alone.
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    from gslts.io.atomic_files import write_atomic
    from gslts.store.describe import describe_event
    from gslts_bench.ros.day import DaySettings, live_day
    from gslts_bench.ros.plot import write_plan

    if out.exists():
        raise FileExistsError(f"{out} is there already")
    out.mkdir(parents=True)
    settings = DaySettings(room, seed, changes, per_round, viewpoints, width, speed)
    result = live_day(out, settings, typer.echo)
    for event in result.events:
        typer.echo(describe_event(event))
    write_plan(out / "plan.png", result)
    write_atomic(out / "result.json", (json.dumps(result.plain(), indent=1) + "\n").encode())
    typer.echo(
        f"{result.found} of {result.changes} changes found, {result.untrue} untrue events; errand: "
        f"{result.errand['status']}; {sum(result.seconds.values()):.0f} s; see {out}/plan.png"
    )
