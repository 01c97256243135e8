"""Pictures of what was detected, right and wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from gslts.change.overlay import overlay
from gslts_bench.detection.cases import frame_of
from gslts_bench.detection.run import DETECTION_S, FRAME_S, Detectors, DetectUnit, Record
from gslts_bench.detection.score import NONE, UNRELIABLE, is_right
from gslts_bench.homes import default_state
from gslts_bench.work import Add, Tell

OF_EACH = 10
"""Right ones, and wrong ones; more of one where there are too few of the other."""
HOME_S = 5.0
"""About how long it takes to open a home and its map, for the progress."""


@dataclass(frozen=True)
class PictureUnit:
    """The pictures of one home.

    Attributes:
        unit: The home.
        chosen: Records of it.
        folder: Where to write.
    """

    unit: DetectUnit
    chosen: tuple[Record, ...]
    folder: Path

    @property
    def name(self) -> str:
        """That of the home."""
        return self.unit.name

    @property
    def results(self) -> None:
        """Pictures are drawn anew each time."""
        return

    def seconds(self, _done: frozenset[str]) -> float:
        """About how long it takes."""
        return HOME_S + len(self.chosen) * (FRAME_S + DETECTION_S)

    def run(self, _done: frozenset[str], _add: Add, tell: Tell) -> None:
        """Detects once more what was chosen, and writes the overlays.

        Raises:
            OSError: They cannot be written.
        """
        told = self.unit.cases()
        cases = {f"{self.name}/{case.name}": case for case in told.cases}
        before = default_state(told.home, told.initial_actions)
        detectors = Detectors(self.unit.bench.map())
        tell(HOME_S)
        for record in self.chosen:
            frame = frame_of(cases[record.case], before, self.unit.bench)
            detection = detectors.of(record.variant).detect(frame)
            Image.fromarray(overlay(detection)).save(self.folder / f"{picture_name(record)}.png")
            tell(FRAME_S + DETECTION_S)


def chosen_of(records: Iterable[Record], variant: str) -> list[Record]:
    """Records of a detector for pictures: as many right as wrong ones, of all parts and homes."""
    own = [one for one in records if one.variant == variant and one.error is None]
    wrong = _spread([one for one in own if not is_right(one)])
    right = _spread([one for one in own if is_right(one) and one.unreliable is None])
    fewer = min(len(wrong), max(OF_EACH, 2 * OF_EACH - len(right)))
    return [*wrong[:fewer], *right[: 2 * OF_EACH - fewer]]


def picture_name(record: Record) -> str:
    """What happened, what was said, and whether that is right."""
    happened = [f"{one.change.kind}-{one.change.object_type}" for one in record.truths]
    counts = Counter(one.kind for one in record.reports)
    said = [f"{count}-{kind}" for kind, count in counts.items()] or [NONE]
    if record.unreliable is not None:
        said = [UNRELIABLE]
    outcome = "right" if is_right(record) else "wrong"
    facts = (record.case.replace("/", "_"), record.variant, outcome, *(happened or [NONE]))
    return "_".join([*facts, "said", *said])


def _spread(records: Sequence[Record]) -> list[Record]:
    """The same, each followed by one of another part and home if there is one."""
    rank: dict[tuple[str, str], int] = {}
    keyed = []
    for number, one in enumerate(records):
        group = (one.part, one.case.partition("/")[0])
        rank[group] = rank.get(group, -1) + 1
        keyed.append((rank[group], number, one))
    return [one for _, _, one in sorted(keyed, key=lambda key: key[:2])]
