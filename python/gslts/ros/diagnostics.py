"""State of the node as a message for diagnostic tools of ROS; needs diagnostic_msgs."""

from __future__ import annotations

from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from gslts.ros.statuses import Status

LEVELS = {
    "ok": DiagnosticStatus.OK,
    "warn": DiagnosticStatus.WARN,
    "error": DiagnosticStatus.ERROR,
    "stale": DiagnosticStatus.STALE,
}
"""Levels of the message."""


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
