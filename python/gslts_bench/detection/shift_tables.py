"""Numbers and table of shifted objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gslts_bench.detection.run import Record
from gslts_bench.detection.score import (
    NONE,
    SHIFT_M,
    UNRELIABLE,
    ShiftScore,
    count_reported_as_shift,
)
from gslts_bench.tables import Table, mean, number, share
from gslts_sim.tasks import KINDS


def shift_summary(shifted: Sequence[Record], others: Sequence[Record]) -> dict[str, Any]:
    """Compute the numbers of one detector.

    Args:
        shifted: Records of shifted objects, without error.
        others: Records of the other parts, without error.

    Returns:
        JSON values; shares as [count, of].
    """
    scores = [ShiftScore.of(record) for record in shifted]
    count = len(scores)
    reported = [score for score in scores if score.said == "shift"]
    visits = [record for record in others if record.part == "unchanged"]
    in_visits = [any(report.kind == "shift" for report in record.reports) for record in visits]
    return {
        "right": [sum(score.right for score in scores), count],
        "wrong_motion": [sum(not score.right for score in reported), count],
        **{
            said: [sum(score.said == said for score in scores), count]
            for said in (*KINDS, NONE, UNRELIABLE)
        },
        "error_cm": _median([100 * s.error_m for s in reported if s.error_m is not None]),
        "error_deg": _median([s.error_deg for s in reported if s.error_deg is not None]),
        "extra_reports": [sum(score.extra for score in scores), count],
        "reported_as_shift": [
            sum(count_reported_as_shift(record) for record in others),
            sum(len(record.truths) for record in others),
        ],
        "visits_with_shifts": [sum(in_visits), len(visits)],
    }


def shift_table(strategies: Mapping[str, dict[str, Any]]) -> Table:
    """Make the table of shifted objects.

    Args:
        strategies: By name of the detector, numbers with `shifted` from `shift_summary`.
    """
    found = [numbers["shifted"] for numbers in strategies.values()]

    def other(numbers: Mapping[str, Any]) -> str:
        return share(sum(numbers[kind][0] for kind in KINDS), numbers["right"][1])

    rows = [
        [f"reported as a shift, to {100 * SHIFT_M:g} cm", *(share(*s["right"]) for s in found)],
        ["reported as a shift, by more off", *(share(*s["wrong_motion"]) for s in found)],
        ["reported as something else", *map(other, found)],
        *([f"- as {name}", *(share(*s[name]) for s in found)] for name in KINDS),
        ["nothing reported there", *(share(*s[NONE]) for s in found)],
        ["unreliable", *(share(*s[UNRELIABLE]) for s in found)],
        ["median error of the motion", *(number(s["error_cm"], 1, "cm") for s in found)],
        ["- of its rotation", *(number(s["error_deg"], 1, "degrees") for s in found)],
        ["other reports in a frame", *(mean(*s["extra_reports"]) for s in found)],
        [
            "changes of other parts reported as a shift",
            *(share(*s["reported_as_shift"]) for s in found),
        ],
        ["no change: visits with a shift", *(share(*s["visits_with_shifts"]) for s in found)],
    ]
    return Table("Shifted objects", ["", *(f"`{name}`" for name in strategies)], rows)


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None
