"""Detection by a robot that turns and confirms changes, in the benchmark."""

from typing import Any

import numpy as np
import pytest

from gslts.change.changes import Change
from gslts.change.config import DetectionConfig
from gslts.change.detection import Detection
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts_bench.detection.watch import TURNS_DEG, turn_views, watch
from gslts_sim.robot_body import Viewpoint

CAMERA = Camera(fx=8, fy=8, cx=4, cy=3, width=8, height=6, world_from_camera=np.eye(4))
FRAME = RgbdFrame(np.zeros((6, 8, 3), np.uint8), np.ones((6, 8), np.float32), CAMERA)


def removal(x: float, confidence: float) -> Change:
    return Change("removal", confidence, np.array([x, 0.0, 1.0]))


class Script:
    """Fake detector that returns a given detection or error for each frame."""

    def __init__(self, said: list[Any]) -> None:
        self.config = DetectionConfig()
        self._said = iter(said)

    def detect(self, _frame: RgbdFrame) -> Detection:
        said = next(self._said)
        photo = np.zeros((6, 8, 3), np.float32)
        if isinstance(said, Exception):
            raise said
        if isinstance(said, str):
            return Detection((), said, CAMERA, photo)
        return Detection(tuple(said), None, CAMERA, photo)


def watched(said: list[Any]) -> tuple[str | None, list[Change]]:
    return watch(Script(said), [FRAME] * len(said))  # type: ignore[arg-type]


def test_the_robot_turns_past_the_viewpoint() -> None:
    viewpoint = Viewpoint(1.0, 2.0, 5.0, 20.0)
    viewpoints = turn_views(viewpoint)
    assert len(viewpoints) == len(TURNS_DEG)
    assert np.mean(TURNS_DEG) == 0
    for turned, turn_deg in zip(viewpoints, TURNS_DEG, strict=True):
        assert turned.yaw_deg == (5.0 + turn_deg) % 360
        assert turned.horizon_deg == 20.0
        np.testing.assert_array_equal(turned.position, viewpoint.position)


def test_changes_in_enough_frames_are_reported() -> None:
    often, once = removal(0.0, 0.8), removal(3.0, 1.0)
    assert watched([[often], [], [often, once], [often], [], []]) == (None, [often])
    assert watched([[often], [], [once], [often], [], []]) == (None, [])


def test_the_most_confident_change_comes_first() -> None:
    unsure, other = removal(0.0, 0.6), removal(3.0, 0.9)
    assert watched([[unsure, other]] * 3) == (None, [other, unsure])


def test_a_watch_without_a_reliable_frame_is_unreliable() -> None:
    change = removal(0.0, 0.8)
    assert watched(["dark"] * 3) == ("each frame is unreliable", [])
    assert watched(["dark", [change], [change], [change]]) == (None, [change])


def test_a_frame_that_fails_raises() -> None:
    with pytest.raises(RuntimeError, match="it has stopped: out of memory"):
        watched([[], MemoryError("out of memory"), []])
