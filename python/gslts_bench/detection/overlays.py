"""Images of detections that are right and wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gslts.change.overlay import overlay
from gslts.fleet.jobs import Add, Jobs, run_units
from gslts.io.atomic_files import empty_folder
from gslts.io.image_files import write_image
from gslts_bench.detection.cases import take_frame
from gslts_bench.detection.run import Detectors, DetectUnit, Record
from gslts_bench.detection.score import NONE, UNRELIABLE, is_right
from gslts_bench.detection.variants import STRATEGIES

OVERLAYS = 20
"""Number of images of a run: half of them right, or more of one where the other has too few."""


@dataclass(frozen=True)
class OverlayUnit:
    """Images of one home.

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
        """Name of the home."""
        return self.unit.name

    @property
    def results(self) -> None:
        """No file: images are drawn anew each time."""
        return

    @property
    def count(self) -> int:
        """Number of images."""
        return len(self.chosen)

    def run(self, _done: frozenset[str], add: Add) -> None:
        """Repeat the detection of the chosen cases, and write the overlays.

        Args:
            _done: Ids of the results of earlier runs; ignored, all images are drawn anew.
            add: Receives each new result.
        """
        home_cases = self.unit.cases()
        cases = {f"{self.name}/{case.name}": case for case in home_cases.cases}
        before = self.unit.bench.default_state(home_cases.initial_actions)
        detectors = Detectors(self.unit.bench.map())
        for record in self.chosen:
            frame = take_frame(cases[record.case], before, self.unit.bench)
            detection = detectors.of(record.variant).detect(frame)
            path = self.folder / f"{file_stem(record)}.png"
            write_image(path, overlay(detection))
            add({"id": path.name})


def draw(
    units: Sequence[DetectUnit], records: Sequence[Record], folder: Path, jobs: Jobs, bar: Any
) -> dict[str, str]:
    """Write overlays of right and wrong answers of the default detector.

    Args:
        units: Units of the run.
        records: Records of the run.
        folder: New or empty folder.
        jobs: Workers.
        bar: Progress bar; see `run_units`.

    Returns:
        Reason by name of the homes that failed.

    Raises:
        OSError: The folder cannot be written.
        ValueError: The folder is not empty.
        ImportError, RuntimeError: See `run_units`.
    """
    empty_folder(folder)
    chosen = choose(records, next(iter(STRATEGIES)))
    work = [
        OverlayUnit(unit, own, folder)
        for unit in units
        if (own := tuple(record for record in chosen if record.case.startswith(f"{unit.name}/")))
    ]
    found = run_units(work, jobs, bar)
    return {name: own[-1]["error"] for name, own in found.items() if own and "error" in own[-1]}


def choose(records: Iterable[Record], variant: str) -> list[Record]:
    """Choose records for images: as many right as wrong ones, of all parts and homes.

    Args:
        records: Records without error.
        variant: The detector.

    Returns:
        At most `OVERLAYS` records, wrong ones first.
    """
    own = [record for record in records if record.variant == variant]
    wrong = _spread([record for record in own if not is_right(record)])
    right = _spread([record for record in own if is_right(record) and record.unreliable is None])
    fewer = min(len(wrong), max(OVERLAYS // 2, OVERLAYS - len(right)))
    return [*wrong[:fewer], *right[: OVERLAYS - fewer]]


def file_stem(record: Record) -> str:
    """Name a record's image by what happened, what was reported, and whether that is right.

    Args:
        record: A record without error.
    """
    happened = [f"{truth.change.kind}-{truth.change.object_type}" for truth in record.truths]
    counts = Counter(report.kind for report in record.reports)
    said = [f"{count}-{kind}" for kind, count in counts.items()] or [NONE]
    if record.unreliable is not None:
        said = [UNRELIABLE]
    outcome = "right" if is_right(record) else "wrong"
    facts = (record.case.replace("/", "_"), record.variant, outcome, *(happened or [NONE]))
    return "_".join([*facts, "said", *said])


def _spread(records: Sequence[Record]) -> list[Record]:
    """Sort records so that each is followed by one of another part and home if there is one."""
    rank: dict[tuple[str, str], int] = {}
    keyed = []
    for number, record in enumerate(records):
        group = (record.part, record.case.partition("/")[0])
        rank[group] = rank.get(group, -1) + 1
        keyed.append((rank[group], number, record))
    return [record for _, _, record in sorted(keyed, key=lambda key: key[:2])]
