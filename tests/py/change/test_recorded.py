"""Surfaces that the recording of a map contradicts."""

from dataclasses import replace

import numpy as np
import pytest

from gslts._core.detect import Side, Surface, Visibility
from gslts.change.changes import Box
from gslts.change.constants import (
    MAX_MISSING_SHARE,
    MAX_RECORDED_SHARE,
    MIN_FREE_SHARE,
    MOVED_MARGIN_M,
)
from gslts.change.recorded import find_recorded
from gslts.change.unknown import surface_fault
from gslts.core.camera import Camera
from gslts.store.recorded_depths import RecordedDepths

CAMERA = Camera(fx=40, fy=40, cx=40, cy=30, width=80, height=60, world_from_camera=np.eye(4))
WALL_M = 2.0


def recording(frames: int, columns: int = 80) -> RecordedDepths:
    """Return images of a wall across z, measured in the left columns only."""
    image = np.zeros((60, 80), np.uint16)
    image[:, :columns] = 1000 * WALL_M
    return RecordedDepths((CAMERA,) * frames, np.tile(image.ravel(), frames))


def surface(z_m: float, side: Side = Side.AFTER, *, flat: bool = False) -> Surface:
    """Return a row of samples from the left to the right of the image."""
    samples = [(x, 0.0, z_m) for x in np.linspace(-0.9 * z_m, 0.9 * z_m, 19)]
    seen = Visibility(on_surface=9, seen_through=1, known_share=1)
    box = {"point": (0, 0, z_m), "low": (-1, -1, z_m), "high": (1, 1, z_m)}
    return Surface(side=side, **box, samples=samples, visibility=seen, flat=flat)


def boxes(*left: Box) -> np.ndarray:
    return np.array(left, np.float64).reshape(-1, 2, 3)


def share(found: Surface, depths: RecordedDepths, *left: Box) -> float:
    find_recorded([found], depths, boxes(*left), boxes(), ())
    assert found.visibility is not None
    assert found.visibility.known_share == 1
    told = surface_fault(found) == "the recording of the map measured this surface"
    assert told == (found.visibility.recorded_share >= MAX_RECORDED_SHARE)
    return found.visibility.recorded_share


def test_what_two_frames_measured_is_not_new() -> None:
    assert share(surface(WALL_M), recording(2)) == 1
    assert share(surface(WALL_M), recording(1)) == 0
    assert share(surface(1.5), recording(2)) == 0
    assert share(surface(WALL_M), recording(2, columns=40)) == pytest.approx(0.5, abs=0.06)


def test_what_few_of_many_frames_measured_may_be_new() -> None:
    near, far = recording(2), replace(recording(7), depths_mm=2 * recording(7).depths_mm)
    assert share(surface(WALL_M), near.extended(far)) == 0
    assert share(surface(WALL_M), near.extended(recording(4))) == 1


def test_what_comes_must_be_where_the_recording_saw_through() -> None:
    def free_share(z_m: float, depths: RecordedDepths, *left: Box) -> float:
        found = surface(z_m)
        find_recorded([found], depths, boxes(*left), boxes(), ())
        assert found.visibility is not None
        fault = "the recording of the map did not see through this position"
        assert (surface_fault(found) == fault) == (found.visibility.free_share < MIN_FREE_SHARE)
        return found.visibility.free_share

    assert free_share(1.5, recording(2)) == 1
    assert free_share(1.5, recording(1)) == 1  # Too little was measured to tell.
    assert free_share(3.0, recording(2)) == 0
    assert free_share(3.0, recording(2, columns=40)) == pytest.approx(0.5, abs=0.06)
    corner = np.array([-3, -0.1, 2.9]), np.array([0, 0.1, 3.1])
    assert free_share(3.0, recording(2), corner) == pytest.approx(0.5, abs=0.06)


def test_where_an_object_left_something_may_come() -> None:
    everywhere = np.array([-3, -0.1, WALL_M]), np.array([3, 0.1, WALL_M])
    beside = np.array([-3, 2 * MOVED_MARGIN_M, WALL_M]), np.array([3, 0.5, WALL_M])
    assert share(surface(WALL_M), recording(2), beside) == 1
    assert share(surface(WALL_M), recording(2), beside, everywhere) == 0


def test_what_the_recording_saw_through_is_not_gone() -> None:
    def missing_share(
        z_m: float, depths: RecordedDepths, *came: Box, added: tuple[int, ...] = ()
    ) -> float:
        found = surface(z_m, Side.BEFORE)
        find_recorded([found], depths, boxes(), boxes(*came), added)
        assert found.visibility is not None
        fault = "the recording of the map saw through this surface"
        is_fault = found.visibility.missing_share > MAX_MISSING_SHARE
        assert (surface_fault(found) == fault) == is_fault
        return found.visibility.missing_share

    assert missing_share(1.5, recording(2)) == 1
    assert missing_share(1.5, recording(1)) == 0  # Too little was measured to tell.
    assert missing_share(WALL_M, recording(2)) == 0
    assert missing_share(3.0, recording(2)) == 0
    assert missing_share(1.5, recording(2, columns=40)) == pytest.approx(0.5, abs=0.06)
    # An object has come there since.
    corner = np.array([-3, -0.1, 1.4]), np.array([0, 0.1, 1.6])
    assert missing_share(1.5, recording(2), corner) == pytest.approx(0.5, abs=0.06)
    assert missing_share(1.5, recording(2), added=(0,)) == 0


def test_only_solid_surfaces_are_compared() -> None:
    assert share(surface(WALL_M, flat=True), recording(2)) == 0
    assert share(surface(WALL_M, Side.BEFORE), recording(2)) == 0
    unseen = surface(WALL_M)
    unseen.visibility = None
    find_recorded([unseen], recording(2), boxes(), boxes(), ())
    assert unseen.visibility is None
