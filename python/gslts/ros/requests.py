"""Requests of other nodes, which wait for the lane that follows them."""

from __future__ import annotations

import queue
from dataclasses import dataclass
from typing import Literal

from gslts.ros.constants import MAX_REQUESTS

Kind = Literal["query", "go", "command"]
COMMANDS = ("build", "explore", "extend", "round", "consolidate")
"""Words of the topic of commands."""


@dataclass(frozen=True)
class Request:
    """A request.

    Attributes:
        kind: Topic that it came on.
        words: Its text.
    """

    kind: Kind
    words: str


class Requests:
    """Bounded queue of requests."""

    def __init__(self) -> None:
        self._queue: queue.Queue[Request] = queue.Queue(MAX_REQUESTS)

    def add(self, request: Request) -> None:
        """Add a request.

        Args:
            request: Its words are checked.

        Raises:
            ValueError: It is no command, or too many requests wait.
        """
        if request.kind == "command" and request.words not in COMMANDS:
            raise ValueError(f"expected one of {', '.join(COMMANDS)}, got {request.words!r}")
        try:
            self._queue.put_nowait(request)
        except queue.Full:
            raise ValueError(f"busy: {MAX_REQUESTS} requests wait already") from None

    def take(self, timeout_s: float) -> Request | None:
        """Take the next request.

        Args:
            timeout_s: Maximum time to wait for it, s.

        Returns:
            The request; None if none came.
        """
        try:
            return self._queue.get(timeout=timeout_s)
        except queue.Empty:
            return None
