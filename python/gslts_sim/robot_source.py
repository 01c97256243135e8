"""Simulated robots by name, for commands: of a day, of a scene change task, or in a home."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from gslts_sim.controller import Controller
from gslts_sim.day import Day, read_day
from gslts_sim.home import Home
from gslts_sim.home_source import FILE_TYPES, open_home
from gslts_sim.task import Task, read_task

NOISE = "kinect"
"""Noise preset of a robot in a home without a script."""


@dataclass(frozen=True)
class SimulatedRobotSource:
    """A simulated robot in a home that changes by a script.

    Args:
        digest: SHA-256 of the script, or of the name of the home.
        home: Home as the script's actions find it.
        script: Day or scene change task; None if nothing changes.
    """

    digest: str
    home: Home
    script: Day | Task | None = None

    @property
    def rounds(self) -> int | None:
        """Number of rounds that meet a change; None without a script."""
        if self.script is None:
            return None
        return len(self.script.rounds) if isinstance(self.script, Day) else 1

    def robot(self, rounds_over: int) -> Controller:
        """Return the robot after the changes of the first rounds.

        Args:
            rounds_over: Number of rounds whose changes have happened.

        Raises:
            ValueError: A change cannot be made.
        """
        if isinstance(self.script, Day):
            return self.script.robot(self.home, rounds_over)
        if isinstance(self.script, Task):
            return self.script.start(self.home, changed=rounds_over > 0)
        return Controller(self.home, noise=NOISE)


def open_simulated_robot(name: str) -> SimulatedRobotSource:
    """Open the simulated robot of a script or a home.

    Args:
        name: Path of a day (`gslts sim day`), of a scene change task (`gslts sim tasks`), of a .glb
            or .gltf file, or a home such as kitchen_3: room type and seed.

    Raises:
        OSError: A file cannot be read.
        ValueError: The name is none of these.
    """
    path = Path(name)
    if path.suffix.lower() != ".json":
        return SimulatedRobotSource(hashlib.sha256(name.encode()).hexdigest(), _home(name))
    script = _read_script(path)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return SimulatedRobotSource(digest, script.home.load(path.parent), script)


def _home(name: str) -> Home:
    if Path(name).suffix.lower() in FILE_TYPES:
        return open_home(name, 0)
    room_type, _, seed = name.rpartition("_")
    if seed.isdecimal():
        return open_home(room_type, int(seed))
    return open_home(name, 0)


def _read_script(path: Path) -> Day | Task:
    try:
        return read_day(path)
    except ValueError as of_day:
        try:
            return read_task(path)
        except ValueError:
            raise ValueError(f"{path}: neither a day nor a scene change task: {of_day}") from None
