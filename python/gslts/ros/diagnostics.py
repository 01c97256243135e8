"""State of the node for diagnostic tools of ROS: streams, memory, and what else it reports."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

Level = Literal["ok", "warn", "error", "stale"]

LEVELS = {
    "ok": DiagnosticStatus.OK,
    "warn": DiagnosticStatus.WARN,
    "error": DiagnosticStatus.ERROR,
    "stale": DiagnosticStatus.STALE,
}
STALE_S = 5.0
"""Age of the newest message at which a stream is stale, s: many periods of the slowest camera, and
short enough that a person who watches sees a dead driver."""
STATM = Path("/proc/self/statm")
"""Memory of this process on Linux, pages."""


@dataclass(frozen=True)
class Status:
    """State of one part of the node.

    Attributes:
        name: Of the part, such as "localization".
        level: How urgent it is.
        message: One line for a person.
        values: Details; None stands for a value that is not known.
    """

    name: str
    level: Level
    message: str
    values: Mapping[str, str | int | float | None] = field(default_factory=dict)


@dataclass(frozen=True)
class StreamCounts:
    """Counts and times of the messages of one topic.

    Attributes:
        received: Number of messages so far.
        dropped: Number of messages that gave way to newer ones.
        rejected: Number of messages that could not be used.
        rate_hz: Messages per second of late.
        age_s: Time since the newest message, s; None before the first one.
        latency_s: Median time from the stamp of a message to its arrival of late, s; None if
            unknown.
        problem: Reason why messages cannot be used now; empty if they can.
    """

    received: int = 0
    dropped: int = 0
    rejected: int = 0
    rate_hz: float = 0.0
    age_s: float | None = None
    latency_s: float | None = None
    problem: str = ""


def stream_status(topic: str, counts: StreamCounts) -> Status:
    """Judge the stream of a topic: stale without messages, a warning if they cannot be used.

    Args:
        topic: Its name.
        counts: Of its messages.
    """
    level: Level = "ok"
    message = f"{counts.rate_hz:.1f} Hz"
    if counts.age_s is None:
        level, message = "stale", "no message yet"
    elif counts.age_s > STALE_S:
        level, message = "stale", f"no message for {counts.age_s:.0f} s"
    elif counts.problem:
        level, message = "warn", counts.problem
    latency_ms = None if counts.latency_s is None else 1000 * counts.latency_s
    values = {
        "received": counts.received,
        "dropped": counts.dropped,
        "rejected": counts.rejected,
        "rate (Hz)": counts.rate_hz,
        "age (s)": counts.age_s,
        "latency (ms)": latency_ms,
    }
    return Status(topic, level, message, values)


def memory_status() -> Status:
    """Report the resident memory of this process; stale where the system does not say it."""
    try:
        pages = int(STATM.read_text(encoding="ascii").split()[1])
    except OSError:
        return Status("memory", "stale", f"{STATM} cannot be read")
    mib = pages * os.sysconf("SC_PAGE_SIZE") / (1 << 20)
    return Status("memory", "ok", f"{mib:.0f} MiB", {"resident (MiB)": mib})


def diagnostic_array(
    header: Header, node: str, map_name: str, statuses: Sequence[Status]
) -> DiagnosticArray:
    """Return the states of all parts.

    Args:
        header: With the stamp; diagnostics have no frame.
        node: Name of the node, before the name of each part.
        map_name: Name of the map: the "hardware" that the states are of.
        statuses: States of the parts.
    """
    return DiagnosticArray(
        header=header,
        status=[
            DiagnosticStatus(
                level=LEVELS[status.level],
                name=f"{node}: {status.name}",
                message=status.message,
                hardware_id=map_name,
                values=[
                    KeyValue(key=key, value=_text(value)) for key, value in status.values.items()
                ],
            )
            for status in statuses
        ],
    )


def _text(value: str | int | float | None) -> str:
    if value is None:
        return "unknown"
    return f"{value:.3f}" if isinstance(value, float) else str(value)
