"""How long the stages of a run take, and when its budget ends."""

from __future__ import annotations

import time
from collections.abc import Mapping


def now_s() -> float:
    """Return the time in s by which all of mapping goes; tests replace it."""
    return time.monotonic()


class Clock:
    """Starts to run when it is made.

    Args:
        budget_s: Of the whole run; None means no limit.
        stages: Seconds that an earlier part of the run took, by stage; they count.
    """

    def __init__(self, budget_s: float | None, stages: Mapping[str, float]) -> None:
        start_s = now_s()
        self.stages = dict(stages)
        self._start_s = start_s - sum(stages.values())
        self._last_s = self._saved_s = start_s
        self._deadline_s = None if budget_s is None else self._start_s + budget_s

    def seconds(self) -> float:
        """Since the start of the run."""
        return now_s() - self._start_s

    def note(self, stage: str) -> None:
        """Adds the time since the last note to a stage."""
        self.stages = self.with_current(stage)
        self._last_s = now_s()

    def with_current(self, stage: str) -> dict[str, float]:
        """Seconds by stage, as if the current one were over."""
        passed_s = now_s() - self._last_s
        return {**self.stages, stage: self.stages.get(stage, 0.0) + passed_s}

    def times_s(self, stage: str, share: float = 1.0) -> tuple[float, float] | None:
        """When a stage started, and when a share of what was left of the budget will be over."""
        if self._deadline_s is None:
            return None
        start_s = now_s() - self.stages.get(stage, 0.0)
        return start_s, start_s + share * max(0.0, self._deadline_s - start_s)

    def saved(self) -> None:
        """Starts the time until the next checkpoint."""
        self._saved_s = now_s()

    def since_saved_s(self) -> float:
        """Since the last checkpoint, or the start."""
        return now_s() - self._saved_s
