"""Benchmark of change detection on real visits: each frame is compared with the first visit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from gslts.change.detector import ChangeDetector
from gslts.change.overlay import overlay
from gslts.datasets import Frame, open_dataset
from gslts.io.images import write_image
from gslts_bench.processes import Add
from gslts_bench.real.boxes import MarkedObject
from gslts_bench.real.score import found_objects, other_reports, reports_of
from gslts_bench.real.visits import RealRoom
from gslts_bench.runner import BenchRecord, BenchUnit, attempt
from gslts_sim.strict_model import STRICT


class JudgedObject(BaseModel):
    """An object that changed.

    Attributes:
        kind: "new" or "missing".
        name: Name of the object.
        found: True if a change was reported there.
    """

    model_config = STRICT

    kind: str
    name: str
    found: bool


class VisitRecord(BenchRecord):
    """Result of one frame; the id is the visit and the frame, such as `scene2/000_0`.

    Attributes:
        room: Name of the room.
        unreliable: Reason why the frame was not compared; None if it was.
        objects: All objects that are new or missing in the image.
        others: Confidences of the reports of nothing that changed.
    """

    room: str
    unreliable: str | None = None
    objects: tuple[JudgedObject, ...] = ()
    others: tuple[float, ...] = ()


@dataclass(frozen=True)
class VisitUnit(BenchUnit[VisitRecord, RealRoom]):
    """Work on one room.

    Attributes:
        images: Folder for overlays of all frames; None for none.
    """

    images: Path | None = None

    topic = "real"
    record = VisitRecord

    @property
    def count(self) -> int:
        """Number of frames of all later visits."""
        return sum(map(len, self.bench.marked.visits.values()))

    def run(self, done: frozenset[str], add: Add) -> None:
        """Compare the frames that are missing.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        asked = [entry for entry in self._frames() if entry[0] not in done or self.images]
        if not asked:
            return
        detector = ChangeDetector.of_map(self.bench.map())
        for name, frame, objects in asked:
            record = VisitRecord(id=name, room=self.name)
            result = attempt(record, partial(self._judge, detector, name, frame, objects))
            if name not in done:
                add(result.model_dump(mode="json"))

    def _frames(self) -> Iterator[tuple[str, Frame, list[MarkedObject]]]:
        for visit, images in self.bench.marked.visits.items():
            folder = self.bench.path / visit
            frames = {frame.name: frame for frame in open_dataset(folder).frames}
            for file, objects in images.items():
                stem = Path(file).stem
                if stem not in frames:
                    raise ValueError(f"{folder}: there is no frame {stem}; expected {file}")
                yield f"{visit}/{stem}", frames[stem], objects

    def _judge(
        self, detector: ChangeDetector, name: str, frame: Frame, objects: list[MarkedObject]
    ) -> dict[str, Any]:
        observed = frame.read()
        detection = detector.detect(observed)
        if self.images is not None:
            path = self.images / f"{self.name}_{name.replace('/', '_')}.png"
            write_image(path, overlay(detection))
        reports = reports_of(detection, observed.camera.width)
        changed = [marked for marked in objects if marked.kind in ("new", "missing")]
        found = found_objects(changed, reports)
        return {
            "unreliable": detection.unreliable,
            "objects": tuple(
                JudgedObject(kind=marked.kind, name=marked.name, found=is_found)
                for marked, is_found in zip(changed, found, strict=True)
            ),
            "others": tuple(report.confidence for report in other_reports(objects, reports)),
        }
