"""State of the node in parts, for diagnostics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from gslts.core.memory import STATM, resident_mib
from gslts.ros.intake import Counts

Level = Literal["ok", "warn", "error", "stale"]


@dataclass(frozen=True)
class Status:
    """State of one part of the node.

    Attributes:
        name: Of the part, such as "frames".
        level: How urgent it is.
        message: One line for a person.
        values: Details; None stands for a value that is not known.
    """

    name: str
    level: Level
    message: str
    values: Mapping[str, str | int | float | None] = field(default_factory=dict)


def statuses(
    counts: Counts,
    latencies_s: Sequence[float],
    problems: Mapping[str, str],
    operation: Status,
) -> list[Status]:
    """Return the states of the parts of the node.

    Args:
        counts: Of the images.
        latencies_s: Times from the stamps of the last frames to their results, s.
        problems: Present problems by subject.
        operation: State of map and robot.
    """
    latency_ms = 1000 * float(np.median(latencies_s)) if latencies_s else None
    parts = [
        Status(
            "frames",
            "ok" if counts.taken else "stale",
            f"{counts.taken} judged, {counts.dropped} of {counts.received} dropped",
            {
                "received": counts.received,
                "dropped": counts.dropped,
                "judged": counts.taken,
                "median latency (ms)": latency_ms,
            },
        ),
        memory_status(),
        operation,
    ]
    return [*parts, *(Status(subject, "warn", line) for subject, line in problems.items())]


def memory_status() -> Status:
    """Report the resident memory of this process; stale where the system does not say it."""
    mib = resident_mib()
    if mib is None:
        return Status("memory", "stale", f"{STATM} cannot be read")
    return Status("memory", "ok", f"{mib:.0f} MiB", {"resident (MiB)": mib})
