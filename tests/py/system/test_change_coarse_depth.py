"""Detection with depth in steps of 4 cm, in which colours decide."""

from dataclasses import replace

import change_room
import numpy as np
import pytest

from gslts.change.changes import Change
from gslts.change.detection import Detection
from gslts.change.detector import ChangeDetector
from gslts.core.frame import RgbdFrame
from gslts.store.records import Updates
from gslts_sim.home import Home

STEP_M = 0.04
SEEDS = range(4)


def coarse(frame: RgbdFrame) -> RgbdFrame:
    """Return the frame with rounded depths."""
    depth = (np.round(frame.depth / STEP_M) * STEP_M).astype(np.float32)
    return replace(frame, depth=depth)


def changed_home(kind: str) -> Home:
    """Return the room with a yellow box more, or without the red one."""
    home = change_room.home()
    if kind == "addition":
        box = change_room.thing("Box|3", 2.6, 1.9, change_room.YELLOW, "Block|1")
        return replace(home, objects=(*home.objects, box))
    return replace(home, objects=tuple(o for o in home.objects if o.id != "Box|1"))


def detect_all(home: Home) -> list[Detection]:
    """Compare coarse frames from all viewpoints of the block with the map."""
    return [
        change_room.detector().detect(coarse(change_room.see(home, viewpoint, "kinect", seed=seed)))
        for viewpoint in change_room.VIEWPOINTS
        for seed in SEEDS
    ]


@pytest.mark.parametrize(("kind", "x", "y"), [("addition", 2.6, 1.9), ("removal", 2.2, 1.85)])
def test_an_object_is_found_by_its_colors(kind: str, x: float, y: float) -> None:
    detections = detect_all(changed_home(kind))
    found = [
        any(
            change.kind == kind and np.linalg.norm(change.point[:2] - (x, y)) < 0.25
            for change in detection.changes
        )
        for detection in detections
    ]
    assert np.mean(found) >= 0.75
    surfaces = [surface for detection in detections for surface in detection.surfaces]
    assert all(surface.color_confidence is not None for surface in surfaces)


def test_what_an_update_added_is_likelier_gone() -> None:
    gaussian_map, cameras = change_room.mapped()
    frame = coarse(change_room.see(changed_home("removal"), change_room.VIEWPOINTS[0], "kinect"))

    def removal(added_ids: list[range]) -> Change:
        detector = ChangeDetector(
            gaussian_map,
            change_room.CONFIG,
            cameras=cameras.values(),
            updates=Updates(added_ids),
        )
        (found,) = detector.detect(frame).changes
        return found

    before = removal([])
    assert before.boxes[0] is not None
    low, high = before.boxes[0]
    means = gaussian_map.means + gaussian_map.origin
    ids = gaussian_map.ids[((means > low - 0.05) & (means < high + 0.05)).all(axis=1)]
    after = removal([range(int(k), int(k) + 1) for k in ids])
    assert before.kind == after.kind == "removal"
    assert before.confidence < after.confidence < 1


def test_nothing_is_found_where_nothing_changed() -> None:
    detections = detect_all(change_room.home())
    assert sum(len(detection.changes) for detection in detections) <= 0.1 * len(detections)


def test_mirrored_frames_are_unreliable() -> None:
    for viewpoint in change_room.VIEWPOINTS:
        frame = coarse(change_room.see(change_room.home(), viewpoint))
        mirrored = replace(
            frame,
            rgb=np.ascontiguousarray(frame.rgb[:, ::-1]),
            depth=np.ascontiguousarray(frame.depth[:, ::-1]),
        )
        assert change_room.detector().detect(mirrored).unreliable is not None
