"""Benchmark of change detection on real visits: frames are compared with the first visit.

Each frame alone, and all frames of a visit with `ChangeMonitor`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel

from gslts.change.detector import ChangeDetector
from gslts.change.overlay import overlay
from gslts.core.frame import RgbdFrame
from gslts.datasets import Frame
from gslts.fleet.jobs import Add
from gslts.io.image_files import write_image
from gslts_bench.real.boxes import JUDGED, MarkedObject
from gslts_bench.real.score import found_objects, other_reports, reports_of
from gslts_bench.real.visit_score import score_visit
from gslts_bench.real.visits import RealRoom
from gslts_bench.runner import BenchRecord, BenchUnit, attempt
from gslts_sim.strict_model import STRICT


class JudgedObject(BaseModel):
    """An object that changed.

    Attributes:
        kind: "new", "missing" or "nudged".
        name: Name of the object.
        found: True if a change was reported there; of a nudged one, a shift.
    """

    model_config = STRICT

    kind: str
    name: str
    found: bool


class VisitRecord(BenchRecord):
    """Result of one frame, such as `scene2/000_0`, or of one visit, such as `scene2`.

    Attributes:
        room: Name of the room.
        part: One frame, or a visit.
        frames: Number of frames.
        unreliable: Number of frames that were not compared.
        objects: All objects that are new, missing or nudged in the images.
        others: Confidences of the reports of nothing that changed.
    """

    room: str
    part: Literal["frame", "visit"]
    frames: int = 1
    unreliable: int = 0
    objects: tuple[JudgedObject, ...] = ()
    others: tuple[float, ...] = ()


@dataclass(frozen=True)
class VisitUnit(BenchUnit[VisitRecord, RealRoom]):
    """Work on one room.

    Attributes:
        images: Folder for overlays of all frames; None for none.
        without_depth: True if the frames of later visits lose their depth.
    """

    images: Path | None = None
    without_depth: bool = False

    topic = "real"
    record = VisitRecord

    @property
    def settings(self) -> dict[str, Any]:
        """JSON values that decide the results besides map and code."""
        return {"without_depth": self.without_depth, **self.bench.judged_of}

    @property
    def count(self) -> int:
        """Number of later visits and of their frames."""
        visits = self.bench.marked.visits
        return len(visits) + sum(map(len, visits.values()))

    def run(self, done: frozenset[str], add: Add) -> None:
        """Compare the frames that are missing.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        detector = ChangeDetector.of_map(self.bench.map())
        for visit in self.bench.marked.visits:
            entries = self.bench.frames(visit)
            for frame, objects in entries:
                name = f"{visit}/{frame.name}"
                record = VisitRecord(id=name, room=self.name, part="frame")
                if name not in done or self.images:
                    result = attempt(record, partial(self._judge, detector, name, frame, objects))
                if name not in done:
                    add(result.model_dump(mode="json"))
            if visit not in done:
                record = VisitRecord(id=visit, room=self.name, part="visit")
                add(
                    attempt(record, partial(self._watch, detector, entries)).model_dump(mode="json")
                )

    def _judge(
        self, detector: ChangeDetector, name: str, frame: Frame, objects: Sequence[MarkedObject]
    ) -> dict[str, Any]:
        observed = self._read(frame)
        detection = detector.detect(observed)
        if self.images is not None:
            path = self.images / f"{self.name}_{name.replace('/', '_')}.png"
            write_image(path, overlay(detection))
        width = observed.camera.width
        reports = [report for change in detection.changes for report in reports_of(change, width)]
        changed = [marked for marked in objects if marked.kind in JUDGED]
        found = found_objects(changed, reports)
        return {
            "unreliable": int(detection.unreliable is not None),
            "objects": tuple(
                JudgedObject(kind=marked.kind, name=marked.name, found=is_found)
                for marked, is_found in zip(changed, found, strict=True)
            ),
            "others": tuple(report.confidence for report in other_reports(objects, reports)),
        }

    def _watch(
        self, detector: ChangeDetector, entries: Sequence[tuple[Frame, Sequence[MarkedObject]]]
    ) -> dict[str, Any]:
        """Confirm changes over a visit; return fields of `VisitRecord`."""
        frames = [self._read(frame) for frame, _ in entries]
        score = score_visit(detector, frames, [objects for _, objects in entries])
        return {
            "frames": score.counts.processed,
            "unreliable": score.counts.unreliable,
            "objects": tuple(
                JudgedObject(kind=kind, name=name, found=found)
                for (kind, name), found in score.found.items()
            ),
            "others": score.others,
        }

    def _read(self, frame: Frame) -> RgbdFrame:
        read = frame.read()
        if not self.without_depth:
            return read
        return replace(read, depth=np.zeros_like(read.depth))
