"""Goals that people choose on a page: sent by the process of the viewer, read by the robot's."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import IO, Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

MAX_TEXT = 200
"""Maximum number of characters of a query on a page, and of the name of an object."""
MAX_GOAL_BYTES = 4096
"""Maximum size of a message: a pipe takes so many bytes as a whole or not at all."""

Corner = tuple[FiniteFloat, FiniteFloat, FiniteFloat]


class Goal(BaseModel):
    """Objects to drive to, the nearest first.

    Attributes:
        words: Query that finds them, or name of the object in the box.
        box: Lower and upper corner of the one object that is meant, in the world, m; None if it
            should be found by the words.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    words: Annotated[str, Field(min_length=1, max_length=MAX_TEXT)]
    box: tuple[Corner, Corner] | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.box is not None and any(a > b for a, b in zip(*self.box, strict=True)):
            raise ValueError("box: the upper corner is below the lower one")
        return self


class GoalSender:
    """Sends goals of all pages to the process of the robot, and never waits for it.

    Args:
        descriptor: Of the end of a pipe that is written.
    """

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor

    def send(self, goal: Goal) -> None:
        """Send a goal.

        Args:
            goal: The goal; the robot forgets an earlier one that it has not begun.

        Raises:
            OSError: The robot takes no goals at present.
        """
        try:
            os.write(self._descriptor, goal.model_dump_json().encode() + b"\n")
        except OSError as error:
            raise OSError(f"the robot takes no goals: {error.strerror}") from None


class PendingGoal:
    """Goal that the robot should follow next: at most one, the newest.

    Args:
        on_change: Called from any thread when `lines` changes.
    """

    def __init__(self, on_change: Callable[[], None]) -> None:
        self._on_change = on_change
        self._goal: Goal | None = None
        self._state = ""
        self._lock = threading.Lock()

    def lines(self) -> list[str]:
        """Describe what the robot does about goals, in at most two lines."""
        with self._lock:
            lines = [self._state] if self._state else []
            if self._goal is not None:
                lines.append(f"{self._goal.words}: sent; the robot ends first what it is doing")
            return lines

    def listen(self, stream: IO[bytes]) -> None:
        """Read goals until the stream ends; what is no goal is dropped.

        Args:
            stream: Of a `GoalSender`.
        """
        while line := stream.readline(MAX_GOAL_BYTES):
            with suppress(ValueError):
                goal = Goal.model_validate_json(line)
                with self._lock:
                    self._goal = goal
                self._on_change()

    def follow(self, drive: Callable[[Goal], str]) -> None:
        """Drive to the pending goal, if there is one.

        Args:
            drive: Moves the robot, and returns how it ended; expected failures are a ValueError or
                an ImportError.
        """
        with self._lock:
            goal, self._goal = self._goal, None
            if goal is None:
                return
            self._state = f"{goal.words}: driving there"
        self._on_change()
        outcome = "given up"
        try:
            outcome = drive(goal)
        except (ValueError, ImportError) as error:
            outcome = str(error)
        finally:
            with self._lock:
                self._state = f"{goal.words}: {outcome}"
            self._on_change()
