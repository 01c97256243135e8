"""Clock of a run: seconds by stage, and the end of the time budget."""

from __future__ import annotations

import time
from collections.abc import Mapping


def now_s() -> float:
    """Return the monotonic time, s, that all of mapping uses; tests replace it."""
    return time.monotonic()


class Clock:
    """Measures the stages of a run; starts when it is constructed.

    Args:
        budget_s: Time limit of the whole run, s; None means no limit.
        stages: Seconds by stage of an interrupted run that this one resumes; they count.
    """

    def __init__(self, budget_s: float | None, stages: Mapping[str, float]) -> None:
        start_s = now_s()
        self.stages = dict(stages)
        self._start_s = start_s - sum(stages.values())
        self._last_s = self._checkpoint_s = start_s
        self._deadline_s = None if budget_s is None else self._start_s + budget_s

    def seconds(self) -> float:
        """Return the time since the start of the run, s."""
        return now_s() - self._start_s

    def note(self, stage: str) -> None:
        """Add the time since the last call to a stage.

        Args:
            stage: Name of the stage that ends now.
        """
        self.stages = self.with_current(stage)
        self._last_s = now_s()

    def with_current(self, stage: str) -> dict[str, float]:
        """Return the seconds by stage, to milliseconds, as if the current stage ended now.

        Args:
            stage: Name of the current stage.
        """
        passed_s = now_s() - self._last_s
        return {**self.stages, stage: round(self.stages.get(stage, 0.0) + passed_s, 3)}

    def times_s(self, stage: str, share: float = 1.0) -> tuple[float, float] | None:
        """Return when a stage started, and when a share of the remaining budget ends.

        Args:
            stage: Name of the current stage.
            share: Share of the budget that was left when the stage started.

        Returns:
            Both by `now_s`, s; None without a budget.
        """
        if self._deadline_s is None:
            return None
        start_s = now_s() - self.stages.get(stage, 0.0)
        return start_s, start_s + share * max(0.0, self._deadline_s - start_s)

    def note_checkpoint(self) -> None:
        """Restart the time since the last checkpoint."""
        self._checkpoint_s = now_s()

    def since_checkpoint_s(self) -> float:
        """Return the time since the last checkpoint, or since the start, s."""
        return now_s() - self._checkpoint_s
