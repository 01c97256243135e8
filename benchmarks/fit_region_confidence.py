"""Fits the weights of `gslts::detect::region_confidence` to real visits with boxes drawn by hand.

    python benchmarks/fit_region_confidence.py DATA/real_changes --swap --work WORK1 WORK2

maps the first visit of each room as `gslts bench real` does, and prints what belongs into
cpp/detect/constants.hpp, and what a fit without a room finds in it. Each later frame counts with
and without its depth. With several folders, each gets a map of its own: maps of the same frames
differ by version, and a fit to two of them carries over better. With --swap, each later visit is
mapped too, coarsely, and compared with the first one, where its new objects are missing; their
boxes are carried over by depth. That fits the weight of the side.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from logistic_regression import fit, logistic
from tqdm import tqdm

from gslts._core import detect as _core
from gslts.change.detection import Detection
from gslts.change.detector import ChangeDetector
from gslts.core.camera import Camera, unproject
from gslts.core.frame import RgbdFrame
from gslts.datasets import open_dataset
from gslts.mapping.config import PRESETS
from gslts.types import Floats, Floats32, Ints32
from gslts_bench.real.boxes import BoxPx, MarkedObject
from gslts_bench.real.score import Report, found_objects, iou, other_reports
from gslts_bench.real.visits import RealRoom, rooms_in

SIDES = {_core.Side.AFTER: "after", _core.Side.BEFORE: "before"}
KINDS = {"after": "new", "before": "missing"}
"""Kind of a marked object by the side on which it is seen."""
MIN_OBJECT_IOU = 0.5
"""Minimum IoU of a region with the box of an object that it shows; from 0.25 on it is unclear."""
MAX_OVERLAP, MAX_BOX_IOU = 0.3, 0.5
"""As in cpp/detect/constants.hpp."""
RIDGE = 10.0
"""Weight of the squared weights of features with unit variance."""
FEATURES = 9
"""Number of the features of a region."""
MAX_OTHERS = 0.15
"""Maximum number of other regions a frame of a room left out of the fit, on both sides. Ends of
relocations, which may be less likely, add other reports; 0.2 are wanted."""
THRESHOLDS = (0.3, 0.4, 0.5, 0.6, 0.7)
"""Minimum confidences of the table."""


class RegionDetector(ChangeDetector):
    """Records the regions of a frame instead of changes."""

    regions: Sequence[_core.Region] = ()

    def _compare(
        self, observed_rgb: Floats32, observed_depth: Floats32, camera: Camera, *others: Any
    ) -> Detection:
        self._shape = observed_depth.shape
        return super()._compare(observed_rgb, observed_depth, camera, *others)

    def _changes(self, views: _core.Views, masks: _core.Masks, *_: Any) -> Any:
        self.regions = _core.find_regions(views, masks, self.config.objects)
        return (), (), np.zeros(self._shape, np.int32)


@dataclass(frozen=True, eq=False)
class Example:
    """The regions of one frame.

    Attributes:
        room: Name of the room.
        objects: Differences in the image.
        features: [N,9].
        reports: Each region as a report, its confidence not known.
        pixels: Indices of the regions' pixels, rising.
    """

    room: str
    objects: list[MarkedObject]
    features: Floats
    reports: list[Report]
    pixels: list[Ints32]

    def labels(self) -> Ints32:
        """Return 1 for regions of objects that changed, 0 for errors, -1 for unclear ones."""
        return np.array([self._label(report) for report in self.reports], np.int32)

    def _label(self, report: Report) -> int:
        own = [o for o in self.objects if o.kind == KINDS[report.side]]
        best = max((iou(marked.box, report.box_px) for marked in own), default=0.0)
        if best >= MIN_OBJECT_IOU:
            return 1
        return 0 if other_reports(self.objects, [report]) else -1


def box_of(region: _core.Region, camera: Camera, width: int) -> BoxPx:
    """Return the box of a region in the pixels of a frame.

    Args:
        region: In the image of the detector.
        camera: Camera of that image.
        width: Width of the frame, px.
    """
    y, x = np.divmod(np.array(region.pixels), camera.width)
    scale = width / camera.width
    return tuple(scale * float(v) for v in (x.min(), y.min(), x.max() + 1, y.max() + 1))


def example(
    room: str, detector: RegionDetector, frame: RgbdFrame, objects: list[MarkedObject]
) -> Example:
    """Return the regions of a frame.

    Args:
        room: Name of the room.
        detector: Detector of the map.
        frame: The frame.
        objects: Differences marked in it.
    """
    detector.regions = ()
    camera = detector.detect(frame).camera
    regions = detector.regions
    return Example(
        room,
        objects,
        np.array([region.features for region in regions]).reshape(len(regions), FEATURES),
        [Report(SIDES[r.side], box_of(r, camera, frame.camera.width), 0.0) for r in regions],
        [np.array(region.pixels, np.int32) for region in regions],
    )


def visits(room: RealRoom, *, without_depth: bool) -> Iterator[Example]:
    """Yield the frames of all later visits against the map of the first one.

    Args:
        room: The room.
        without_depth: True if the frames lose their depth.
    """
    detector = RegionDetector.of_map(room.map())
    for visit in tqdm(room.marked.visits, room.name):
        for frame, objects in room.frames(visit):
            read = frame.read()
            if without_depth:
                read = replace(read, depth=np.zeros_like(read.depth))
            yield example(room.name, detector, read, list(objects))


def carry_box(box: BoxPx, source: RgbdFrame, target: Camera) -> BoxPx | None:
    """Return where another camera sees a box, by the median depth in it.

    Args:
        box: Box in the source frame.
        source: Frame of one visit.
        target: Camera of another visit.

    Returns:
        The box; None if it is not in view, or no depth is measured.
    """
    x0, y0, x1, y1 = map(round, box)
    depths = source.depth[y0:y1, x0:x1]
    if not (depths > 0).any():
        return None
    corners = np.array([[x0, y0], [x1, y0], [x0, y1], [x1, y1]], np.float64)
    world = unproject(source.camera, corners, np.full(4, np.median(depths[depths > 0])))
    rotation, position = target.world_from_camera[:3, :3], target.world_from_camera[:3, 3]
    points = (world - position) @ rotation
    if (points[:, 2] <= 0).any():
        return None
    pixels = points[:, :2] / points[:, 2:] * (target.fx, target.fy) + (target.cx, target.cy)
    low = np.clip(pixels.min(axis=0), 0, (target.width, target.height))
    high = np.clip(pixels.max(axis=0), 0, (target.width, target.height))
    inside = np.prod(high - low) / max(1.0, float(np.prod(np.ptp(pixels, axis=0))))
    return (*map(float, low), *map(float, high)) if inside > 0.5 else None


def swapped_visits(room: RealRoom) -> Iterator[Example]:
    """Yield the frames of the first visit against maps of the later ones: new objects are missing.

    Args:
        room: The room.
    """
    reference = open_dataset(room.reference).frames
    for visit, images in tqdm(room.marked.visits.items(), f"{room.name}, swapped"):
        frames = {frame.name: frame.read() for frame in open_dataset(room.path / visit).frames}
        marked = room.marked.model_copy(update={"reference": visit})
        detector = RegionDetector.of_map(RealRoom(room.path, marked, room.mapping, room.work).map())
        for first in (frame.read() for frame in reference):
            objects = []
            for file, found in images.items():
                for item in found:
                    box = carry_box(item.box, frames[Path(file).stem], first.camera)
                    kind = {"new": "missing", "missing": "new"}.get(item.kind, item.kind)
                    if box is not None:
                        update = {"kind": kind, "box_px": list(box)}
                        objects.append(item.model_copy(update=update))
            yield example(room.name, detector, first, objects)


def fit_examples(examples: Sequence[Example]) -> tuple[Floats, float]:
    """Return weights and offset for all clear regions.

    Args:
        examples: Regions of frames.
    """
    labels = np.concatenate([frame.labels() for frame in examples])
    features = np.vstack([frame.features for frame in examples])
    clear = labels >= 0
    *weights, offset = fit(features[clear], labels[clear], np.ones(clear.sum()), RIDGE)
    return np.array(weights), float(offset)


def are_same(frame: Example, i: int, j: int) -> bool:
    """Return True if two regions show one object, as in cpp/detect/regions.cpp.

    Args:
        frame: Regions of a frame.
        i: Number of a region.
        j: Number of another one.
    """
    common_box = iou(frame.reports[i].box_px, frame.reports[j].box_px)
    if common_box == 0:
        return False
    a, b = frame.pixels[i], frame.pixels[j]
    common = len(np.intersect1d(a, b, assume_unique=True))
    return common_box > MAX_BOX_IOU or common > MAX_OVERLAP * min(len(a), len(b))


def chosen(frame: Example, weights: Floats, offset: float) -> list[Report]:
    """Return the regions that remain, with their confidences, as `find_changed_regions` does.

    Args:
        frame: Regions of a frame.
        weights: [9].
        offset: Of the logistic regression.
    """
    p = logistic(frame.features @ weights + offset)
    kept: list[int] = []
    for i in np.argsort(-p, kind="stable"):
        if not any(are_same(frame, i, j) for j in kept):
            kept.append(i)
    return [Report(frame.reports[i].side, frame.reports[i].box_px, float(p[i])) for i in kept]


def left_out(examples: Sequence[Example]) -> list[tuple[Example, list[Report]]]:
    """Return the reports of each frame by a fit without its room.

    Args:
        examples: Regions of frames.
    """
    reports = []
    for room in sorted({frame.room for frame in examples}):
        fitted = fit_examples([frame for frame in examples if frame.room != room])
        reports += [(frame, chosen(frame, *fitted)) for frame in examples if frame.room == room]
    return reports


def operating_shift(reports: Sequence[tuple[Example, list[Report]]]) -> float:
    """Return the shift of the log odds with which few enough other reports reach 0.5.

    Args:
        reports: From `left_out`.
    """
    others = [r.confidence for frame, found in reports for r in other_reports(frame.objects, found)]
    first = sorted(others, reverse=True)[int(MAX_OTHERS * len(reports))]
    return -float(np.log(first / (1 - first)))


def shifted(
    reports: Sequence[tuple[Example, list[Report]]], parts: Sequence[Example], shift: float
) -> list[tuple[Example, list[Report]]]:
    """Return the reports of some frames with shifted log odds.

    Args:
        reports: From `left_out`.
        parts: Frames to choose.
        shift: Added to the log odds.
    """

    def shift_one(report: Report) -> Report:
        odds = np.log(report.confidence / (1 - report.confidence))
        return replace(report, confidence=float(logistic(odds + shift)))

    own = {id(frame) for frame in parts}
    return [(frame, list(map(shift_one, found))) for frame, found in reports if id(frame) in own]


def print_table(title: str, reports: Sequence[tuple[Example, list[Report]]]) -> None:
    """Print what is found.

    Args:
        title: Name of the frames.
        reports: Reports of each frame.
    """
    print(f"\n{title}: minimum confidence, new and missing found, others a frame (after, before)")
    for threshold in THRESHOLDS:
        counts = {"new": [0, 0], "missing": [0, 0]}
        others = {"after": 0, "before": 0}
        for frame, all_reports in reports:
            likely = [report for report in all_reports if report.confidence >= threshold]
            changed = [o for o in frame.objects if o.kind in counts]
            for marked, is_found in zip(changed, found_objects(changed, likely), strict=True):
                counts[marked.kind][0] += is_found
                counts[marked.kind][1] += 1
            for report in other_reports(frame.objects, likely):
                others[report.side] += 1
        shares = [f"{a} of {b} ({100 * a / max(1, b):.0f} %)" for a, b in counts.values()]
        means = [f"{count / max(1, len(reports)):.2f}" for count in others.values()]
        print(f"{threshold:.1f}  {'  '.join(shares)}  {'  '.join(means)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder with a folder per room")
    parser.add_argument("--swap", action="store_true", help="also map the later visits")
    parser.add_argument(
        "--work", type=Path, nargs="+", default=[Path("out/bench")], help="folders for the maps"
    )
    arguments = parser.parse_args()
    folder, works = arguments.folder, arguments.work
    rooms = [room for work in works for room in rooms_in(folder, PRESETS["balanced"], work)]
    later = [frame for room in rooms for frame in visits(room, without_depth=False)]
    depthless = [frame for room in rooms for frame in visits(room, without_depth=True)]
    swapped: list[Example] = []
    if arguments.swap:
        for room in rooms_in(folder, PRESETS["fast"], works[0]):
            swapped += swapped_visits(room)
    examples = later + depthless + swapped
    reports = left_out(examples)
    shift = operating_shift(
        [entry for entry in reports if any(entry[0] is frame for frame in later)]
    )
    print_table("Later visits in the map of the first", shifted(reports, later, shift))
    print_table("The same without depth", shifted(reports, depthless, shift))
    print_table("First visit in maps of later ones", shifted(reports, swapped, shift))
    weights, offset = fit_examples(examples)
    print(f"\nconstexpr double kRegionOffset = {offset + shift:.3f};")
    for weight in weights:
        print(f"    {weight:.3f},")


if __name__ == "__main__":
    main()
