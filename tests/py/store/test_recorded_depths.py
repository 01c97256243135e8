"""Small depth images of a recording: a wall 2 m ahead."""

from dataclasses import replace

import numpy as np
import pytest

from gslts.core.camera import Camera, camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.store.recorded_depths import (
    KEYS,
    MARGIN_M,
    MARGIN_SHARE,
    NO_RECORDED_DEPTHS,
    WIDTH_PX,
    RecordedDepths,
    small_depth_image,
)

DEPTH_M = 2.0
EYE = np.array([10.0, -5.0, 1.0])


def at(x_m: float, y_m: float = 0.0) -> np.ndarray:
    """Return a point [1,3] ahead of the camera."""
    return EYE[None] + (x_m, y_m, 0.0)


def frame(depth_m: float = DEPTH_M, width: int = 320) -> RgbdFrame:
    """Return a frame along x of a wall."""
    camera = camera_from_fov(width, 3 * width // 4, 1.0, look_at(EYE, at(1.0)[0]))
    depth = np.full((camera.height, width), depth_m, np.float32)
    return RgbdFrame(np.zeros((camera.height, width, 3), np.uint8), depth, camera)


def recorded(*frames: RgbdFrame) -> RecordedDepths:
    cameras, depths_mm = zip(*map(small_depth_image, frames), strict=True)
    return RecordedDepths(cameras, np.concatenate(depths_mm))


@pytest.mark.parametrize("width", [40, 320, 642])
def test_images_are_counted_by_where_they_measured_a_surface(width: int) -> None:
    depths = recorded(frame(width=width), frame(DEPTH_M / 2, width), frame(width=width))
    margin_m = MARGIN_M + MARGIN_SHARE * DEPTH_M
    places = at(DEPTH_M), at(DEPTH_M + 0.9 * margin_m), at(DEPTH_M + 1.2 * margin_m), at(1.0)
    counts = depths.counts(np.concatenate([*places, at(-DEPTH_M), at(DEPTH_M, 3.0)]))
    assert counts.before.tolist() == [1, 1, 3, 0, 0, 0]
    assert counts.on.tolist() == [2, 2, 0, 1, 0, 0]
    assert counts.behind.tolist() == [0, 0, 0, 2, 0, 0]


def test_images_are_small_and_keep_single_depths() -> None:
    seen = frame()
    seen.depth[:, ::2] = 4.0  # Neither the mean of both, 3 m, is measured nor anything else.
    camera, depths_mm = small_depth_image(seen)
    assert (camera.width, camera.height) == (WIDTH_PX, 3 * WIDTH_PX // 4)
    assert set(np.unique(depths_mm)) <= {2000, 4000}


@pytest.mark.parametrize("unknown", [0.0, np.nan, np.inf, 70.0, -1.0])
def test_what_is_not_measured_or_masked_is_no_surface(unknown: float) -> None:
    half = frame()
    half.depth[:, 160:] = unknown  # The image's right is at -y.
    mask = np.ones(half.depth.shape, np.bool_)
    mask[:, 160:] = False
    for seen in (half, replace(frame(), mask=mask)):
        counts = recorded(seen).counts(np.concatenate([at(2, 0.5), at(2, -0.5), at(1, -0.2)]))
        assert counts.on.tolist() == [1, 0, 0]
        assert counts.behind.tolist() == counts.before.tolist() == [0, 0, 0]


def test_arrays_are_read_as_written() -> None:
    depths = recorded(frame(), frame(3.0, 200))
    read = RecordedDepths.from_arrays(depths.to_arrays())
    assert len(read.cameras) == 2
    points = np.concatenate([at(2.0), at(3.0), at(1.0)])
    assert read.counts(points).on.tolist() == depths.counts(points).on.tolist() == [1, 1, 0]
    assert RecordedDepths.from_arrays({}) is NO_RECORDED_DEPTHS
    assert NO_RECORDED_DEPTHS.counts(points).on.tolist() == [0, 0, 0]
    empty = RecordedDepths.from_arrays(NO_RECORDED_DEPTHS.to_arrays())
    assert empty.counts(points).on.tolist() == [0, 0, 0]


@pytest.mark.parametrize("key", KEYS)
def test_damaged_arrays_are_rejected(key: str) -> None:
    arrays = recorded(frame(), frame()).to_arrays()
    missing = {name: array for name, array in arrays.items() if name != key}
    with pytest.raises(KeyError, match=key):
        RecordedDepths.from_arrays(missing)
    with pytest.raises(ValueError, match=r"expected uint16|zip\(\)|shorter|longer"):
        RecordedDepths.from_arrays({**arrays, key: arrays[key][:1]})
    with pytest.raises((ValueError, TypeError)):
        RecordedDepths.from_arrays({**arrays, key: np.full_like(arrays[key], -1, np.float64)})


def test_depths_must_fit_their_cameras() -> None:
    camera = Camera(fx=2, fy=2, cx=1, cy=1, width=2, height=2, world_from_camera=np.eye(4))
    with pytest.raises(ValueError, match=r"depths_mm: expected uint16 \(4,\), got uint16 \(3,\)"):
        RecordedDepths((camera,), np.zeros(3, np.uint16))
