"""Change detection in a recorded room: in frames that a map was not made of, nothing changed.

Changes are made in the map instead, so that the frames show the opposite.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any, Literal

from gslts.change.changes import SIDES, Change, Side
from gslts.change.config import DetectionConfig
from gslts.change.detection import Detection
from gslts.change.detector import ChangeDetector
from gslts.change.monitor import confirm_changes
from gslts.change.overlay import overlay
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.fleet.jobs import Add
from gslts.io.image_files import write_image
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import read_map
from gslts_bench.detection.run import Detectors
from gslts_bench.detection.variants import STRATEGIES
from gslts_bench.real.map_changes import SIDES_OF, MapChange, make_changes
from gslts_bench.real.score import MIN_IOU, iou
from gslts_bench.relocalization.room import RecordedRoom, RoomFold
from gslts_bench.runner import BenchRecord, BenchUnit, attempt

EVERY = 2
"""Every n-th frame is held out; there are so many maps. The frames that remain of 7-Scenes are half
a second apart, as those of a `ChangeMonitor`."""
VIEWS = 60
"""Maximum number of changes of each kind that are made in a map."""
GIVEN, LOCATED = "objects", "located"
"""Detectors of `STRATEGIES` that see frames at given poses, and at localized ones."""

Part = Literal["frame", "sequence", "addition", "removal", "relocation"]


class RoomRecord(BenchRecord):
    """Result of one frame, of one sequence, or of one view of a change.

    Attributes:
        part: Unchanged frame, unchanged sequence, or kind of the change.
        detector: Name in `STRATEGIES`.
        object_name: Fold and number of the changed object; empty without a change.
        frames: Number of frames.
        unreliable: Number of frames that were not compared.
        right: True if the most certain change is right.
        found: True if any change is right.
        others: Confidences of the reports of nothing that changed; of a sequence, the confirmed.
    """

    part: Part
    detector: str
    object_name: str = ""
    frames: int = 1
    unreliable: int = 0
    right: bool = False
    found: bool = False
    others: tuple[float, ...] = ()


@dataclass(frozen=True)
class RoomUnit(BenchUnit[RoomRecord, RoomFold]):
    """Work on one map of a room.

    Attributes:
        images: Folder for overlays of all views of changes; None for none.
    """

    images: Path | None = None

    topic = "real_room"
    record = RoomRecord

    @property
    def count(self) -> int:
        """Number of results when all is done, at most."""
        return len(STRATEGIES) * len(self.bench.frames) + 2 + VIEWS * len(SIDES_OF)

    def run(self, done: frozenset[str], add: Add) -> None:
        """Compare what is missing.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        for record, answer in _Comparisons(self.bench, self.images).all():
            if record.id not in done:
                add(attempt(record, answer).model_dump(mode="json"))
            elif self.images is not None and record.object_name:
                answer()


class RoomViews:
    """Held-out frames of a room, and changes made in the map of the other frames.

    Args:
        bench: The room and its held-out frames.
    """

    def __init__(self, bench: RoomFold) -> None:
        folder = bench.map()
        self._map = read_map(folder)
        self._training = list(cameras_of_map(folder).values())
        self._plain = ChangeDetector.of_map(folder, DetectionConfig(threads=1))
        self._frames = {frame.name: cache(frame.read) for frame in bench.frames}
        self._aligned: Callable[[str], Camera] = cache(self._align)

    @property
    def names(self) -> list[str]:
        """Names of the frames."""
        return list(self._frames)

    def frame(self, name: str) -> RgbdFrame:
        """Read a frame.

        Args:
            name: Its name.
        """
        return self._frames[name]()

    @cached_property
    def changes(self) -> list[MapChange]:
        """Changes of the map, each with the frame that shows it."""
        cameras = {name: read().registered().camera for name, read in self._frames.items()}
        return make_changes(self._map, self._training, cameras, VIEWS, seed=0)

    def detect(self, change: MapChange, detector: ChangeDetector) -> Detection:
        """Compare the frame of a change with the changed map.

        Args:
            change: One of `changes`.
            detector: With the settings; its map is not used.
        """
        changed = detector.with_map(
            change.changed_map(self._map), self._training, change.made(self._map)
        )
        return changed.detect(self.frame(change.frame))

    def truth(self, change: MapChange) -> Change:
        """Return the change that its frame shows, with masks.

        Args:
            change: One of `changes`.
        """
        return change.truth(self._map, self._aligned(change.frame))

    def _align(self, name: str) -> Camera:
        """Return the camera of a frame as aligned to the unchanged map."""
        return self._plain.detect(self.frame(name)).camera


class _Comparisons:
    """All comparisons of held-out frames with a map."""

    def __init__(self, bench: RoomFold, images: Path | None) -> None:
        self._name, self._images = bench.name, images
        self._views, self._detectors = RoomViews(bench), Detectors(bench.map())

    def all(self) -> Iterator[tuple[RoomRecord, Callable[[], Mapping[str, Any]]]]:
        """Yield a record without its result for each comparison, and the comparison."""
        for name in self._views.names:
            for detector in STRATEGIES:
                record = RoomRecord(id=f"{name}: {detector}", part="frame", detector=detector)
                yield record, partial(self._compare, name, detector)
        for detector in (GIVEN, LOCATED):
            record = RoomRecord(id=f"sequence: {detector}", part="sequence", detector=detector)
            yield record, partial(self._watch, detector)
        for change in self._views.changes:
            record = RoomRecord(
                id=f"{change.kind}/{change.name}",
                part=change.kind,
                detector=GIVEN,
                object_name=f"{self._name}/{change.object_name.partition('_')[0]}",
            )
            yield record, partial(self._find, change)

    def _compare(self, name: str, detector: str) -> dict[str, Any]:
        frame = self._views.frame(name)
        if STRATEGIES[detector].locate:
            frame = self._detectors.localize(frame)
        return _false_reports(self._detectors.of(detector).detect(frame))

    def _watch(self, detector: str) -> dict[str, Any]:
        frames = [self._views.frame(name) for name in self._views.names]
        if STRATEGIES[detector].locate:
            localizer = self._detectors.localizer()
            frames = [localizer.localize_frame(frame) for frame in frames]
        changes, counts = confirm_changes(self._detectors.of(detector), frames)
        return {
            "frames": counts.processed,
            "unreliable": counts.unreliable,
            "others": tuple(change.confidence for change in changes),
        }

    def _find(self, change: MapChange) -> dict[str, Any]:
        detection = self._views.detect(change, self._detectors.of(GIVEN))
        width = self._views.frame(change.frame).camera.width
        result = judge(self._views.truth(change), detection, width)
        if self._images is not None:
            outcome = "right" if result["right"] else "wrong"
            stem = f"{self._name}_{change.kind}_{change.name.replace('/', '_')}_{outcome}"
            write_image(self._images / f"{stem}.png", overlay(detection))
        return result


def judge(truth: Change, detection: Detection, width: int) -> dict[str, Any]:
    """Judge a detection where one object changed; return fields of `RoomRecord`.

    Args:
        truth: The change, with masks of its regions.
        detection: Result of the detector.
        width: Width of the frame, px.
    """
    right = [_is_right(truth, change, width) for change in detection.changes]
    return {
        "unreliable": int(detection.unreliable is not None),
        "right": bool(right) and right[0],
        "found": any(right),
        "others": tuple(
            change.confidence
            for change in detection.changes
            if not any(_overlaps(truth, change, side, width) for side in SIDES)
        ),
    }


def _is_right(truth: Change, change: Change, width: int) -> bool:
    sides = [side for side in SIDES if truth.box_px(side, width) is not None]
    return change.kind == truth.kind and all(
        _overlaps(truth, change, side, width) for side in sides
    )


def _overlaps(truth: Change, change: Change, side: Side, width: int) -> bool:
    """Return whether a side of a reported change is where that of the true one is."""
    own, other = truth.box_px(side, width), change.box_px(side, width)
    return own is not None and other is not None and iou(own, other) >= MIN_IOU


def _false_reports(detection: Detection) -> dict[str, Any]:
    return {
        "unreliable": int(detection.unreliable is not None),
        "others": tuple(change.confidence for change in detection.changes),
    }


def units_of(room: RecordedRoom, images: Path | None) -> list[RoomUnit]:
    """List the work in a room.

    Args:
        room: The room.
        images: Folder for overlays of all views of changes; None for none.
    """
    return [RoomUnit(RoomFold(room, fold, EVERY), images) for fold in range(EVERY)]
