"""A day of a simulated robot over ROS 2.

It explores and maps a room, finds changes, and goes to an object that moved; no human helps.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gslts.store.history import open_history
from gslts.store.records import Event
from gslts.types import Floats
from gslts_bench.days.events import is_untrue, true_events, was_found
from gslts_bench.ros.director import TIMEOUT_S, Director
from gslts_sim.day import ChangeEvent, read_day
from gslts_sim.task import Change

RATE_HZ = "3"
"""Frames per second of the robot: each takes 0.14 s of a core that the node lacks."""


@dataclass(frozen=True)
class DaySettings:
    """Settings of a day.

    Attributes:
        room: Room type.
        seed: Of the home.
        changes: Number of changes.
        per_round: Number of changes before each round.
        viewpoints: Maximum number of viewpoints of a round.
        width: Of the images, px.
        speed: Factor of the speeds of the robot.
    """

    room: str = "living_room"
    seed: int = 3
    changes: int = 6
    per_round: int = 2
    viewpoints: int = 12
    width: int = 640
    speed: float = 1.0


@dataclass(frozen=True, eq=False)
class DayResult:
    """Outcome of a day.

    Attributes:
        seconds: By step.
        found: Number of changes that the map shows at their true positions.
        changes: Number of changes.
        untrue: Number of events that did not happen.
        answer: Answer to the query for an object that moved.
        errand: Result of the errand to it.
        events: Of the map.
        path: Positions (2,) of the camera, x and y in the map, m.
        grid: Free floor as OccupancyGrid.
    """

    seconds: dict[str, float]
    found: int
    changes: int
    untrue: int
    answer: dict[str, Any]
    errand: dict[str, Any]
    events: Sequence[Event]
    path: Sequence[Floats]
    grid: Any

    def plain(self) -> dict[str, Any]:
        """Return the result as values of JSON."""
        return {
            "seconds": self.seconds,
            "found": self.found,
            "changes": self.changes,
            "untrue": self.untrue,
            "objects": len(self.answer["objects"]),
            "errand": self.errand["status"],
        }


def live_day(out: Path, settings: DaySettings, log: Callable[[str], None]) -> DayResult:
    """Let the robot map a room and live a day, with the nodes as processes of their own.

    Args:
        out: New folder: the day, the map, the recording, the bag and the logs of the nodes.
        settings: Of the day.
        log: Called with a line for each step.

    Raises:
        OSError: A file cannot be written.
        RuntimeError: A node failed.
        TimeoutError: A step took too long.
    """
    size = ("--width", str(settings.width), "--height", str(settings.width * 3 // 4))
    home = (settings.room, str(settings.seed))
    events = make_day(out, home, size, settings.changes)
    seconds: dict[str, float] = {}
    start_s = time.monotonic()

    def note(step: str) -> None:
        seconds[step] = time.monotonic() - start_s - sum(seconds.values())
        log(f"{step}: {seconds[step]:.0f} s")

    with Director(out / "bag", log) as director:
        script = ("--day", f"{out}/day/day.json", "--speed", str(settings.speed), "--rate", RATE_HZ)
        robot = start(out, "robot", "sim", "ros", *home, *size, *script)
        director.processes["gslts sim ros"] = robot
        try:
            map_from_world = director.odometry_from_world()
            node = start(
                out,
                "gslts",
                *("ros", "--map", str(out / "map"), "--build", "--active"),
                *("--pose", "/camera/pose", "--tilt", "/tilt_controller/commands"),
                *("--labels", "/camera/labels", "--label-names", "/camera/label_names"),
                *("--viewpoints", str(settings.viewpoints)),
            )
            director.processes["gslts ros"] = node
            try:
                answer, errand = _direct(director, events, settings, note, log)
            finally:
                stop(node, "gslts ros")
        finally:
            stop(robot, "gslts sim ros")
        path, grid = director.path, director.grid
    with open_history(out / "map") as history:
        reported = history.events()
    true = true_events([_in_frame(event.change, map_from_world) for event in events])
    return DayResult(
        seconds,
        found=sum(was_found(change, reported) for change in true),
        changes=len(true),
        untrue=sum(is_untrue(event, true) for event in reported),
        answer=answer,
        errand=errand,
        events=reported,
        path=path,
        grid=grid,
    )


def _direct(
    director: Director,
    events: Sequence[ChangeEvent],
    settings: DaySettings,
    note: Callable[[str], None],
    log: Callable[[str], None],
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Ask for the steps of the day; return the answer to the query, and that to the errand."""
    director.wait("event", "explored")
    note("exploration")
    director.wait("event", "built")
    note("building the map")
    for first in range(0, len(events), settings.per_round):
        for _ in events[first : first + settings.per_round]:
            log(director.ask_robot("change"))
        director.say("command", "round")
        director.wait("event", "done")
        note(f"round {1 + first // settings.per_round}")
    target = [event.change for event in events if event.change.kind != "removal"][-1].object_type
    director.say("query", target)
    answer = director.wait("query", target)
    director.say("go", target)
    errand = director.wait("go", target)
    note(f"query and errand to {target}")
    return answer, errand


def make_day(
    out: Path, home: Sequence[str], size: Sequence[str], changes: int, frames: int = 1
) -> list[ChangeEvent]:
    """Write the changes of a day, and return them.

    Args:
        out: Folder; gets the folder `day`.
        home: Room type and seed.
        size: Options of the size of images.
        changes: Number of changes.
        frames: Maximum number of frames of the recording before the day.

    Raises:
        OSError: A file cannot be written.
        RuntimeError: So many changes are not possible.
    """
    folder = out / "day"
    options = ("--changes", str(changes), "--frames", str(frames), "--out", str(folder))
    command = [sys.executable, "-m", "gslts", "sim", "day", *home, *size, *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    return [event for events in read_day(folder / "day.json").rounds for event in events]


def start(out: Path, name: str, *arguments: str) -> subprocess.Popen[bytes]:
    """Start a command of gslts in a process of its own.

    Args:
        out: Folder of its log file.
        name: Name of the log file.
        arguments: Of the command.

    Raises:
        OSError: The log file cannot be written.
    """
    with (out / f"{name}.log").open("ab") as log:
        return subprocess.Popen(
            [sys.executable, "-m", "gslts", *arguments], stdout=log, stderr=subprocess.STDOUT
        )


def stop(process: subprocess.Popen[bytes], name: str) -> None:
    """End a process, and wait until it has ended.

    Args:
        process: Of `start`.
        name: Named in errors.

    Raises:
        RuntimeError: It failed.
    """
    process.send_signal(signal.SIGINT)
    if (status := process.wait(TIMEOUT_S)) != 0:
        raise RuntimeError(f"{name} ended with exit status {status}; see its log")


def _in_frame(change: Change, frame_from_world: Floats) -> Change:
    """Return a true change in another frame, with the boxes around its turned boxes."""
    boxes = {}
    for name in ("box_before", "box_after"):
        box = getattr(change, name)
        if box is not None:
            corners = np.array(np.meshgrid(*np.array(box).T)).reshape(3, 8).T
            turned = corners @ frame_from_world[:3, :3].T + frame_from_world[:3, 3]
            boxes[name] = (tuple(turned.min(axis=0).tolist()), tuple(turned.max(axis=0).tolist()))
    return change.model_copy(update=boxes)
