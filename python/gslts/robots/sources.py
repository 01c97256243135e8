"""Robots by name: installed packages register openers as entry points of group `gslts.robots`."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Protocol

from gslts.core.robot import Robot

GROUP = "gslts.robots"
"""Entry point group: name of a kind of robot, and its opener, `str -> RobotSource`."""


class RobotSource(Protocol):
    """Opens the robot of a command, as its surroundings change from round to round.

    Attributes:
        digest: SHA-256 of what defines the robot, so that interrupted rounds go on with the same.
        rounds: Number of rounds after which nothing changes any more; None if unlimited.
    """

    digest: str
    rounds: int | None

    def robot(self, rounds_over: int) -> Robot:
        """Return the robot after the changes of the first rounds.

        Args:
            rounds_over: Number of rounds whose changes have happened.

        Raises:
            ValueError: A change cannot be made.
        """
        ...


def open_robot(name: str) -> RobotSource:
    """Open the robot that a name or a file stands for.

    Args:
        name: As the openers of the installed packages define it, such as the path of a script.

    Raises:
        OSError: A file cannot be read.
        ValueError: No installed package knows the name, or its opener returns no `RobotSource`.
    """
    openers = list(entry_points(group=GROUP))
    if not openers:
        raise ValueError(f"{name}: no installed package registers robots ({GROUP})")
    reasons = []
    for opener in openers:
        try:
            source: RobotSource = opener.load()(name)
        except ValueError as error:
            reasons.append(str(error))
        else:
            missing = {"digest", "rounds", "robot"} - set(dir(source))
            if missing:
                raise ValueError(
                    f"{name}: {opener.value} returns no RobotSource: no {min(missing)}"
                )
            return source
    raise ValueError("; ".join(reasons))
