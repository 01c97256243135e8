"""Problems of a running node: logged once, and again only if they last."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from gslts.ros.constants import SAY_AGAIN_S


class Problems:
    """Logs each problem at most every `SAY_AGAIN_S`, and remembers the present ones.

    Args:
        log: Called with one line.
        clock: Returns the time, s.
    """

    def __init__(
        self, log: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._log, self._clock = log, clock
        self._lines: dict[str, tuple[str, float, float]] = {}
        self._lock = threading.Lock()

    def report(self, subject: str, line: str) -> None:
        """Report a problem.

        Args:
            subject: What has the problem, such as a topic; it has one at a time.
            line: One line that names the problem.
        """
        now_s = self._clock()
        with self._lock:
            known, said_s, _ = self._lines.get(subject, ("", -SAY_AGAIN_S, 0.0))
            is_due = known != line or now_s - said_s >= SAY_AGAIN_S
            # Several problems may alternate: the time since the last line counts for all of them.
            is_due = is_due and (known == "" or now_s - said_s >= SAY_AGAIN_S / 10)
            self._lines[subject] = (line, now_s if is_due else said_s, now_s)
        if is_due:
            self._log(f"{subject}: {line}")

    def present(self) -> dict[str, str]:
        """Return the problems of the last `SAY_AGAIN_S`, by subject."""
        now_s = self._clock()
        with self._lock:
            return {
                subject: line
                for subject, (line, _, last_s) in self._lines.items()
                if now_s - last_s < SAY_AGAIN_S
            }
