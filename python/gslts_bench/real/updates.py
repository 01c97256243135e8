"""Benchmark of updates by real visits: a map of the first visit, updated visit after visit."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gslts.change.changes import Change
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.fleet.jobs import Add
from gslts.io.image_files import write_image
from gslts.rendering.losses import Exposure, apply_exposure
from gslts.rendering.metrics import psnr_from_mse_db
from gslts.rendering.rasterizer import Rasterizer
from gslts.robots.recorded import RecordedRobot
from gslts.store.map_folder import read_map
from gslts.types import Bools, Bytes, Floats32
from gslts.update.config import UpdateConfig
from gslts.update.evidence import MIN_VIEWS
from gslts.update.pipeline import update_map
from gslts.update.region import Region, regions_of
from gslts_bench.real.boxes import BoxPx, MarkedObject
from gslts_bench.real.score import MIN_IOU, iou
from gslts_bench.real.visit_score import CONFIRMATION
from gslts_bench.real.visits import RealRoom
from gslts_bench.runner import BenchRecord, BenchUnit, attempt
from gslts_bench.update.score import align_with_map

AROUND_PX = 20
"""Margin around the boxes of objects within which nothing counts as unchanged, px."""


class UpdateRecord(BenchRecord):
    """Result of the update by one visit; the id is its name.

    Attributes:
        room: Name of the room.
        status: Status of the update; see `MapUpdate`.
        reason: Reason for a rejection; None otherwise.
        true: Number of changes in the new version that happened.
        untrue: Number of changes in the new version of which no image shows that they happened.
        new: Number of new objects in the held-out frame that at least two other frames show.
        new_db: PSNR in their boxes, with the map of the first visit and with the updated map;
            None without such an object.
        elsewhere_db: PSNR away from all differences, likewise.
    """

    room: str
    status: str = ""
    reason: str | None = None
    true: int = 0
    untrue: int = 0
    new: int = 0
    new_db: tuple[float, float] | None = None
    elsewhere_db: tuple[float, float] | None = None


class _Entry(NamedTuple):
    """A frame of a visit, and the differences marked in it."""

    frame: RgbdFrame
    marked: Sequence[MarkedObject]


@dataclass(frozen=True)
class UpdateUnit(BenchUnit[UpdateRecord, RealRoom]):
    """Work on one room: its visits follow each other, so all are done anew.

    Attributes:
        images: Folder for held-out frames beside the maps before and after; None for none.
    """

    images: Path | None = None

    topic = "real_updates"
    record = UpdateRecord

    @property
    def settings(self) -> dict[str, Any]:
        """JSON values that decide the results besides map and code."""
        return self.bench.judged_of

    @property
    def count(self) -> int:
        """Number of later visits."""
        return len(self.bench.marked.visits)

    def run(self, done: frozenset[str], add: Add) -> None:
        """Update the map with each visit, unless all were done.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        visits = list(self.bench.marked.visits)
        if done.issuperset(visits) and self.images is None:
            return
        with tempfile.TemporaryDirectory(dir=self.bench.work) as folder:
            path = Path(folder) / "map"
            shutil.copytree(self.bench.map(), path)
            earlier: list[_Entry] = []
            for visit in visits:
                record = UpdateRecord(id=visit, room=self.name)
                result = attempt(record, partial(self._update, path, visit, earlier))
                if visit not in done:
                    add(result.model_dump(mode="json"))

    def _update(self, path: Path, visit: str, earlier: list[_Entry]) -> dict[str, Any]:
        """Update the map with all frames of a visit but one; return fields of the record.

        Args:
            path: The map.
            visit: Name of the visit.
            earlier: Frames of earlier visits; those of this one are added.
        """
        entries = [_Entry(frame.read(), marked) for frame, marked in self.bench.frames(visit)]
        held_out, rest = _hold_out(entries)
        frames = [entry.frame for entry in rest]
        done = update_map(
            path,
            RecordedRobot(frames),
            UpdateConfig(threads=1),
            frames=frames,
            monitor=CONFIRMATION,
        )
        changes = () if done.result is None else done.result.changes
        true = [_is_marked(change, rest, earlier) for change in changes]
        earlier += entries
        maps = first, _ = read_map(Path(f"{path}@1")), read_map(path)
        comparison = _Comparison(first, held_out, rest)
        before, after = map(comparison.errors, maps)
        if self.images is not None:
            image = comparison.image(maps)
            write_image(self.images / f"{self.name}_{visit}.png", image)
        return {
            "status": done.status,
            "reason": done.reason,
            "true": sum(true),
            "untrue": len(true) - sum(true),
            "new": comparison.new,
            "new_db": _pair_db(before[0], after[0]),
            "elsewhere_db": _pair_db(before[1], after[1]),
        }


class _Comparison:
    """A held-out frame, aligned with the map of the first visit where nothing changed."""

    def __init__(self, first: GaussianMap, held_out: _Entry, rest: Sequence[_Entry]) -> None:
        frame = held_out.frame.registered()
        shape = frame.rgb.shape[:2]
        differs = _mask_of([marked.box for marked in held_out.marked], shape, AROUND_PX)
        self._elsewhere: Bools = ~differs if frame.mask is None else frame.mask & ~differs
        new = [marked.box for marked in _updatable(held_out, rest)]
        self.new, self._in_new = len(new), _mask_of(new, shape, 0)
        aligned = RgbdFrame(frame.rgb, frame.depth, frame.camera, mask=self._elsewhere)
        self._camera: Camera
        self._exposure: Exposure
        self._camera, self._exposure, _ = align_with_map(aligned, first)
        self._observed = frame.rgb.astype(np.float32) / np.float32(255)

    def errors(self, gaussian_map: GaussianMap) -> tuple[float | None, float | None]:
        """Return the mean squared error in the boxes of new objects, and elsewhere."""
        squares = (self._render(gaussian_map) - self._observed) ** 2
        masks = (self._in_new, self._elsewhere)
        new, elsewhere = [float(squares[m].mean()) if m.any() else None for m in masks]
        return new, elsewhere

    def image(self, maps: Sequence[GaussianMap]) -> Bytes:
        """Return the frame beside renderings of some maps."""
        images = [self._observed, *(self._render(each) for each in maps)]
        row: Bytes = np.rint(255 * np.hstack(images)).astype(np.uint8)
        return row

    def _render(self, gaussian_map: GaussianMap) -> Floats32:
        images = Rasterizer(np.float32).forward(gaussian_map, self._camera)
        rendered: Floats32 = apply_exposure(images.rgb, self._exposure).clip(0, 1)
        return rendered


def _hold_out(entries: Sequence[_Entry]) -> tuple[_Entry, list[_Entry]]:
    """Split off the frame with most new objects by which a map can be updated without it."""
    splits = [(entry, [*entries[:row], *entries[row + 1 :]]) for row, entry in enumerate(entries)]
    return max(splits, key=lambda split: len(_updatable(*split)))


def _updatable(held_out: _Entry, rest: Sequence[_Entry]) -> list[MarkedObject]:
    """Return the new objects in a frame that enough other frames show, too."""
    names = [marked.name for entry in rest for marked in entry.marked]
    return [
        marked
        for marked in held_out.marked
        if marked.kind == "new" and names.count(marked.name) >= MIN_VIEWS
    ]


def _is_marked(change: Change, entries: Sequence[_Entry], earlier: Sequence[_Entry]) -> bool:
    """Return whether an image has a difference marked where a box of a change is.

    What is gone may have been new in an earlier visit, and a shift is of what is marked as nudged.
    """
    if change.kind == "shift":
        entries, earlier = [_without_changes(entry) for entry in entries], ()
    regions = regions_of(change)
    return any(
        _is_marked_at(region, entries)
        or (region.side == "before" and _is_marked_at(region, earlier))
        for region in regions
    )


def _without_changes(entry: _Entry) -> _Entry:
    marked = [marked for marked in entry.marked if marked.kind not in ("new", "missing")]
    return _Entry(entry.frame, marked)


def _is_marked_at(region: Region, entries: Sequence[_Entry]) -> bool:
    return any(
        (box := region.project_box(entry.frame.registered().camera, 0)) is not None
        and any(
            iou(box, marked.box) >= MIN_IOU or _center_in(marked.box, box)
            for marked in entry.marked
        )
        for entry in entries
    )


def _center_in(inner: BoxPx, outer: BoxPx) -> bool:
    """Return whether the centre of a box is in another one, such as that of two objects."""
    x, y = (inner[0] + inner[2]) / 2, (inner[1] + inner[3]) / 2
    return outer[0] <= x < outer[2] and outer[1] <= y < outer[3]


def _mask_of(boxes: Sequence[BoxPx], shape: tuple[int, ...], margin_px: int) -> Bools:
    """Return [H,W] pixels in some boxes."""
    mask = np.zeros(shape, np.bool_)
    for x0, y0, x1, y1 in boxes:
        rows = slice(max(0, int(y0) - margin_px), int(y1) + margin_px)
        mask[rows, max(0, int(x0) - margin_px) : int(x1) + margin_px] = True
    return mask


def _pair_db(before: float | None, after: float | None) -> tuple[float, float] | None:
    if before is None or after is None:
        return None
    return psnr_from_mse_db(before), psnr_from_mse_db(after)
