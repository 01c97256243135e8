"""Alignment of a frame's pose with a map: where it ends, and after how many steps."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import gslts.localization.alignment as alignment
from gslts import Camera, RgbdFrame, render
from gslts.core.camera import at_pose
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import pose_distance, se3_retract
from gslts.localization.constants import MAX_ALIGN_STEPS
from gslts_bench.synthetic_rooms import make_room

OFF = np.array([0.012, -0.012, 0.01, 0.01, -0.01, 0.01])  # 2 cm and 1 degree.
STDS = (0.01, 0.0087)


@cache
def room() -> tuple[GaussianMap, Camera]:
    """Return a map, and a camera of 300 x 300 px in it."""
    size = make_room("S")
    return size.gaussian_map.astype(np.float32), size.camera


def frame_at(pose: np.ndarray) -> RgbdFrame:
    """Return what the camera of the room sees, with noise, believed to be at a pose [4,4]."""
    gaussian_map, camera = room()
    images = render(gaussian_map, camera)
    noise = np.random.default_rng(0).normal(0, 0.01, images.rgb.shape)
    rgb = (255 * (images.rgb + noise)).clip(0, 255).astype(np.uint8)
    return RgbdFrame(rgb, images.depth.astype(np.float32), at_pose(camera, pose))


def off_pose() -> np.ndarray:
    return se3_retract(room()[1].world_from_camera, OFF)


def aligned(frame: RgbdFrame, threads: int = 1) -> np.ndarray:
    frames = [frame.halved(), frame]
    return alignment.align_pose(room()[0], frames, stds=STDS, threads=threads)


@pytest.fixture
def widths(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Image widths of all steps."""
    found: list[int] = []
    solve = alignment._solve_step

    def counted(equations: alignment.Alignment, camera: Camera, *rest: np.ndarray) -> np.ndarray:
        found.append(camera.width)
        return solve(equations, camera, *rest)

    monkeypatch.setattr(alignment, "_solve_step", counted)
    return found


def test_a_pose_that_is_off_converges(widths: list[int]) -> None:
    true = room()[1].world_from_camera
    distance_m, angle_rad = pose_distance(true, aligned(frame_at(off_pose())))
    assert distance_m < 0.002
    assert angle_rad < 0.001
    assert max(widths.count(150), widths.count(300)) < MAX_ALIGN_STEPS


def test_a_right_pose_takes_few_steps(widths: list[int]) -> None:
    true = room()[1].world_from_camera
    distance_m, angle_rad = pose_distance(true, aligned(frame_at(true)))
    assert distance_m < 0.002
    assert angle_rad < 0.001
    assert len(widths) <= 4  # Two at each resolution.
    easy = len(widths)
    widths.clear()
    aligned(frame_at(off_pose()))
    assert len(widths) > easy


@pytest.mark.parametrize(("ratio", "length"), [(0.5, 2.0), (0.9, 3.0), (-0.5, 1.0), (1.5, 1.0)])
def test_shrinking_steps_are_extended(ratio: float, length: float) -> None:
    """Extend the step to the limit of a geometric series, at most by two of its length."""
    camera, depth = room()[1], np.full((300, 300), 2.0)
    last = alignment._Step.of(OFF, camera, depth)
    step = alignment._Step.of(ratio * OFF, at_pose(camera, last.end), depth)
    found = pose_distance(last.end, step.extrapolate(last))
    expected = pose_distance(last.end, se3_retract(last.end, length * ratio * OFF))
    np.testing.assert_allclose(found, expected, rtol=0.01)


def test_motion_is_that_at_the_median_depth() -> None:
    camera, depth = room()[1], np.full((300, 300), 2.0)
    depth[:, :100] = 0
    shift = alignment._Step.of(np.array([0.02, 0, 0, 0, 0, 0]), camera, depth)
    turn = alignment._Step.of(np.array([0, 0, 0, 0, 0.01, 0]), camera, depth)
    assert shift.motion_px == pytest.approx(camera.fx * 0.01)
    assert turn.motion_px == pytest.approx(camera.fx * 0.01)


def test_a_frame_that_shows_nothing_of_the_map_stays_where_it_is() -> None:
    gaussian_map, camera = room()
    frame = replace(frame_at(camera.world_from_camera), depth=np.zeros((300, 300), np.float32))
    nothing = gaussian_map.select(np.arange(0))
    pose = alignment.align_pose(nothing, [frame.halved(), frame], threads=1)
    np.testing.assert_array_equal(pose, camera.world_from_camera)


def test_the_number_of_threads_changes_nothing() -> None:
    frame = frame_at(off_pose())
    assert aligned(frame, 1).tobytes() == aligned(frame, 3).tobytes()
