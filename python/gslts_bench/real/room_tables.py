"""Numbers and tables of change detection in a recorded room."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gslts_bench.detection.variants import STRATEGIES
from gslts_bench.real.map_changes import SIDES_OF
from gslts_bench.real.room_run import RoomRecord
from gslts_bench.runner import Benchmark
from gslts_bench.tables import Table, mean, share

LABELS = {
    "objects": "`objects`, given poses",
    "located": "`objects`, `--localize`",
    "gs_lts": "`gs_lts`, given poses",
}
"""Names of the detectors in the tables."""


def summarize(records: Sequence[RoomRecord]) -> dict[str, Any]:
    """Compute the numbers of changes, unchanged frames and sequences.

    Args:
        records: Records without error.

    Returns:
        JSON values.
    """
    changes = [record for record in records if record.part in SIDES_OF]
    parts: dict[str, list[RoomRecord]] = {
        kind: [r for r in changes if r.part == kind] for kind in SIDES_OF
    }
    return {
        "changes": {name: _numbers(own) for name, own in (parts | {"all": changes}).items()},
        **{
            part: {
                detector: _numbers(own)
                for detector in STRATEGIES
                if (own := [r for r in records if (r.part, r.detector) == (part, detector)])
            }
            for part in ("frame", "sequence")
        },
    }


def _numbers(records: Sequence[RoomRecord]) -> dict[str, Any]:
    return {
        "records": len(records),
        "objects": len({record.object_name for record in records}),
        "frames": sum(record.frames for record in records),
        "unreliable": sum(record.unreliable for record in records),
        "right": sum(record.right for record in records),
        "found": sum(record.found for record in records),
        "with_others": sum(bool(record.others) for record in records),
        "others": sum(len(record.others) for record in records),
    }


def tabulate(summary: Mapping[str, Any]) -> list[Table]:
    """Make the tables.

    Args:
        summary: From `summarize`.
    """
    return [
        _changes(summary["changes"]),
        _frames(summary["frame"]),
        _sequences(summary["sequence"]),
    ]


def _changes(kinds: Mapping[str, Any]) -> Table:
    rows = [
        (
            kind,
            str(own["records"]),
            str(own["objects"]),
            share(own["right"], own["records"]),
            share(own["found"], own["records"]),
            mean(own["others"], own["records"]),
            share(own["unreliable"], own["records"]),
        )
        for kind, own in kinds.items()
    ]
    return Table(
        "Changes made in the map",
        (
            "change in the frame",
            "views",
            "objects",
            "most certain report right",
            "right by any report",
            "other reports a view",
            "unreliable",
        ),
        rows,
        "Right: of the right kind, and the boxes of the reported regions and of the object have "
        "an IoU of at least 0.25, for relocations at both ends.",
    )


def _frames(detectors: Mapping[str, Any]) -> Table:
    rows = [
        (
            LABELS[name],
            share(own["with_others"], own["frames"]),
            mean(own["others"], own["frames"]),
            share(own["unreliable"], own["frames"]),
        )
        for name, own in detectors.items()
    ]
    header = ("detector", "frames with a false report", "false reports a frame", "unreliable")
    return Table("Unchanged frames", header, rows)


def _sequences(detectors: Mapping[str, Any]) -> Table:
    rows = [
        (
            LABELS[name],
            str(own["records"]),
            str(own["frames"]),
            str(own["others"]),
            share(own["unreliable"], own["frames"]),
        )
        for name, own in detectors.items()
    ]
    header = ("detector", "sequences", "frames", "confirmed changes, all false", "unreliable")
    return Table("Unchanged sequences through `ChangeMonitor`", header, rows)


BENCHMARK = Benchmark("Recorded room", "comparing", summarize, tabulate)
"""The benchmark of change detection in a recorded room."""
