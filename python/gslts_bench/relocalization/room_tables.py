"""The results of relocalization in a recorded room, as numbers and as a table in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from gslts_bench.markdown import table
from gslts_bench.relocalization.fold import RoomRecord
from gslts_bench.relocalization.score import scores
from gslts_bench.relocalization.tables import LOCATED_HEADER, located_row

TRUTHS = {"given": "by the given poses", "corrected": "by poses corrected in a map of all frames"}


def room_summary(records: Iterable[RoomRecord]) -> dict[str, Any]:
    """In values of JSON; shares as counts."""
    done = [one for one in records if one.error is None]
    answers = {truth: [getattr(one, truth) for one in done] for truth in TRUTHS}
    return {
        "maps": len({one.fold for one in done}),
        **{
            truth: scores([one for one in some if one is not None])
            for truth, some in answers.items()
        },
    }


def room_printed(found: Mapping[str, Any]) -> str:
    """All there is."""
    return "\n\n".join(
        [
            "## Relocalization in a recorded room",
            f"Each frame in a map made without it; {found['maps']} map(s)",
            table(
                LOCATED_HEADER,
                [located_row(words, found[truth]) for truth, words in TRUTHS.items()],
            ),
        ]
    )
