"""Undistorted images compared with scenes whose colour is known in every direction."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gslts.core.camera import Camera
from gslts.datasets.image_frame import ImageFrame
from gslts.datasets.undistort import Lens, lens_or_none, undistort_depth, undistort_rgb

CAMERA = Camera(
    fx=100.0, fy=104.0, cx=77.3, cy=63.8, width=160, height=120, world_from_camera=np.eye(4)
)
LENSES = {
    "barrel": Lens((-0.25, 0.06, 0.004, -0.003)),
    "pincushion": Lens((0.12, 0.02, -0.002, 0.003, 0.01)),
    "rational": Lens((0.3, 0.1, 0.001, 0.002, 0.02, 0.15, 0.05, 0.01)),
    "fisheye": Lens((-0.03, 0.01, -0.002, 0.001), fisheye=True),
}


def undistort(
    rgb: np.ndarray, depth: np.ndarray, camera: Camera, lens: Lens
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    flat, mask = undistort_rgb(rgb, camera, lens)
    return flat, undistort_depth(depth, camera, lens), mask


def project(lens: Lens, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Project the directions (x, y, 1) through a lens; returns u and v, px.

    Written from the formulas in OpenCV's documentation of camera calibration.
    """
    r2 = x * x + y * y
    if lens.fisheye:
        r = np.sqrt(r2)
        theta = np.arctan(r)
        k1, k2, k3, k4 = lens.coefficients
        bent = theta * (1 + k1 * theta**2 + k2 * theta**4 + k3 * theta**6 + k4 * theta**8)
        scale = np.where(r > 1e-9, bent / np.maximum(r, 1e-9), 1.0)
        x, y = x * scale, y * scale
    else:
        k1, k2, p1, p2, k3, k4, k5, k6 = (*lens.coefficients, 0, 0, 0, 0)[:8]
        scale = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
        x, y = (
            x * scale + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * scale + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )
    return CAMERA.fx * x + CAMERA.cx, CAMERA.fy * y + CAMERA.cy


def centres() -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[: CAMERA.height, : CAMERA.width] + 0.5
    return x, y


def directions() -> tuple[np.ndarray, np.ndarray]:
    """(x, y) of the directions (x, y, 1) of a pinhole's pixels."""
    x, y = centres()
    return (x - CAMERA.cx) / CAMERA.fx, (y - CAMERA.cy) / CAMERA.fy


def colour(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """[H,W,3] of directions: waves 20 px long, so that half a pixel makes a difference of 20."""
    waves = (np.sin(33 * x), np.sin(33 * y), np.cos(25 * (x + y)))
    return np.rint(127 + 120 * np.stack(waves, axis=-1)).astype(np.uint8)


def distorted(lens: Lens) -> np.ndarray:
    """Render the scene through a lens; iterations find the direction of each pixel."""
    (u, v), (x, y) = centres(), directions()
    for _ in range(60):
        projected_u, projected_v = project(lens, x, y)
        x, y = x - (projected_u - u) / CAMERA.fx, y - (projected_v - v) / CAMERA.fy
    assert max(np.abs(projected_u - u).max(), np.abs(projected_v - v).max()) < 1e-3
    return colour(x, y)


@pytest.mark.parametrize("name", LENSES)
def test_colours_come_from_the_direction_of_their_pixel(name: str) -> None:
    lens = LENSES[name]
    depth = np.ones((120, 160), np.float32)
    flat, near, mask = undistort(distorted(lens), depth, CAMERA, lens)
    error = np.abs(flat.astype(float) - colour(*directions()))[mask]
    assert error.mean() < 2
    assert error.max() < 12

    x, y = project(lens, *directions())
    inside = (x > 0.51) & (x < 159.49) & (y > 0.51) & (y < 119.49)
    outside = (x < 0.49) | (x > 159.51) | (y < 0.49) | (y > 119.51)
    assert mask[inside].all()
    assert not mask[outside].any()
    assert outside.any() == (name in ("pincushion", "rational"))
    assert (flat[~mask] == 0).all()
    np.testing.assert_array_equal(near, mask.astype(np.float32))


def test_depth_is_never_mixed() -> None:
    depth = np.where(centres()[0] < 70, 1.0, 3.0).astype(np.float32)
    depth[50:60] = 0
    rgb = np.zeros((120, 160, 3), np.uint8)
    near = undistort(rgb, depth, CAMERA, LENSES["barrel"])[1]
    assert set(np.unique(near)) == {0.0, 1.0, 3.0}
    x = project(LENSES["barrel"], *directions())[0]
    y = project(LENSES["barrel"], *directions())[1]
    clear = (y < 49.5) | (y > 60.5)
    assert (near[clear & (x < 69.5)] == 1).all()
    assert (near[clear & (x > 70.5)] == 3).all()


def test_a_polynomial_that_turns_back_shows_nothing_twice() -> None:
    """The radius r (1 - r^2 / 2) has its maximum at r = 0.816; beyond it, pixels would repeat."""
    flat, _, mask = undistort(
        np.full((120, 160, 3), 200, np.uint8),
        np.ones((120, 160), np.float32),
        CAMERA,
        Lens((-0.5, 0.0, 0.0, 0.0)),
    )
    radius = np.hypot(*directions())
    assert mask[radius < 0.81].all()
    assert not mask[radius > 0.82].any()
    assert (flat[mask] == 200).all()


def test_lenses_that_hardly_distort_lose_no_border() -> None:
    rgb = colour(*directions())
    flat, _, mask = undistort(
        rgb, np.ones((120, 160), np.float32), CAMERA, Lens((1e-9, 0.0, 0.0, 0.0))
    )
    assert mask.all()
    np.testing.assert_array_equal(flat, rgb)
    assert lens_or_none((0, 0, 0, 0)) is None
    assert lens_or_none((0, 0, 0, 0), fisheye=True) is not None


def test_unknown_lens_models_are_rejected() -> None:
    with pytest.raises(ValueError, match="the lens has 3 coefficients"):
        Lens((0.1, 0.2, 0.3))
    with pytest.raises(ValueError, match="the lens has 8 coefficients"):
        Lens((0.1,) * 8, fisheye=True)
    with pytest.raises(ValueError, match="nan"):
        Lens((0.1, float("nan"), 0.0, 0.0))


def test_frames_are_undistorted_when_read(tmp_path: Path) -> None:
    lens = LENSES["pincushion"]
    rgb = distorted(lens)
    Image.fromarray(rgb).save(tmp_path / "a.png")
    Image.fromarray(np.full((120, 160), 1500, np.uint16)).save(tmp_path / "a_depth.png")
    frame = ImageFrame(tmp_path / "a.png", CAMERA, tmp_path / "a_depth.png", lens=lens).read()
    depth = np.full((120, 160), 1.5, np.float32)
    flat, near, mask = undistort(rgb, depth, CAMERA, lens)
    assert frame.mask is not None
    np.testing.assert_array_equal(frame.mask, mask)
    np.testing.assert_array_equal(frame.rgb, flat)
    np.testing.assert_array_equal(frame.depth, near)
    assert ImageFrame(tmp_path / "a.png", CAMERA).read().mask is None
