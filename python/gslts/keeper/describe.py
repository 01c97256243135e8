"""State of a map keeper in words."""

from __future__ import annotations

from gslts.core.memory import resident_mib
from gslts.keeper.keeper import MapKeeper


def describe_keeper(keeper: MapKeeper) -> list[str]:
    """Describe what a keeper does, and what it has deferred.

    Args:
        keeper: In use.

    Returns:
        Lines of text.
    """
    state, counts, fault = keeper.state, keeper.monitor.counts, keeper.monitor.fault
    lines = [f"round {state.round}, {len(state.remaining or ())} viewpoints left"]
    lines.append(
        f"{counts.processed} frames compared, {counts.dropped} dropped, "
        f"{counts.unreliable} unreliable"
    )
    if fault is not None:
        lines.append(f"not compared: {fault}")
    memory_mib = resident_mib()
    if memory_mib is not None:
        lines.append(f"{memory_mib:.0f} MiB of memory")
    return [*lines, *(change.describe() for change in state.deferred)]
