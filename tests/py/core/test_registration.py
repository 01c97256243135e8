"""Depth carried into another camera's view, against planes whose depth is known."""

import time

import numpy as np
import pytest

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame, register_depth
from gslts.core.se3 import rotation
from gslts.mapping.observation import Observation


def camera(
    width: int = 160, focal: float = 140.0, turn: tuple = (0, 0, 0), place: tuple = (0, 0, 0)
) -> Camera:
    """With a principal point that is in the middle of nothing."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(np.array(turn, np.float64)), place
    return Camera(
        fx=focal,
        fy=1.02 * focal,
        cx=0.52 * width,
        cy=0.36 * width,
        width=width,
        height=3 * width // 4,
        world_from_camera=pose,
    )


def points(view: Camera, depth: np.ndarray) -> np.ndarray:
    """[H,W,3] in the world, of the pixels' centres."""
    y, x = np.mgrid[: view.height, : view.width] + 0.5
    rays = np.stack([(x - view.cx) / view.fx, (y - view.cy) / view.fy, np.ones_like(x)], axis=-1)
    pose = view.world_from_camera
    return (depth[..., None] * rays) @ pose[:3, :3].T + pose[:3, 3]


def plane_depth(view: Camera, normal: np.ndarray, distance: float) -> np.ndarray:
    """[H,W] z of the plane normal . x = distance."""
    pose = view.world_from_camera
    rays = points(view, np.ones((view.height, view.width))) - pose[:3, 3]
    return ((distance - normal @ pose[:3, 3]) / (rays @ normal)).astype(np.float32)


BESIDE = camera(turn=(0.02, -0.03, 0.04), place=(0.05, 0.01, -0.02))


@pytest.mark.parametrize(
    "target",
    [BESIDE, camera(320, 260.0, (0.02, -0.03, 0.1), (0.05, 0.01, -0.02)), camera(64, 50.0)],
    ids=["beside", "larger", "smaller"],
)
def test_a_slanted_plane_stays_itself_and_closed(target: Camera) -> None:
    normal = np.array([0.8, 0.4, -1.0]) / np.linalg.norm([0.8, 0.4, -1.0])
    source = camera(turn=(0.3, 0.1, 0))
    target = Camera(
        fx=target.fx,
        fy=target.fy,
        cx=target.cx,
        cy=target.cy,
        width=target.width,
        height=target.height,
        world_from_camera=source.world_from_camera @ target.world_from_camera,
    )
    registered = register_depth(plane_depth(source, normal, -2.0), source, target)
    expected = plane_depth(target, normal, -2.0)
    assert np.ptp(expected) > 1, expected.max()
    # The two views do not show the same part of the plane.
    in_source = (
        points(target, expected) - source.world_from_camera[:3, 3]
    ) @ source.world_from_camera[:3, :3]
    x = source.fx * in_source[..., 0] / in_source[..., 2] + source.cx
    y = source.fy * in_source[..., 1] / in_source[..., 2] + source.cy
    inside = (x > 2) & (x < source.width - 2) & (y > 2) & (y < source.height - 2)
    outside = (x < -2) | (x > source.width + 2) | (y < -2) | (y > source.height + 2)
    assert inside.mean() > 0.5
    assert (registered[inside] > 0).all()
    assert (registered[outside] == 0).all()
    error = np.abs(registered - expected)[inside] / expected[inside]
    assert error.max() < 2e-6


def test_noise_neither_tears_a_surface_nor_moves_it() -> None:
    source, normal = camera(turn=(0.3, 0.1, 0)), np.array([0.3, 0.2, -0.9])
    place = source.world_from_camera @ BESIDE.world_from_camera
    target = camera(320, 270.0)
    target = Camera(
        fx=target.fx,
        fy=target.fy,
        cx=target.cx,
        cy=target.cy,
        width=target.width,
        height=target.height,
        world_from_camera=place,
    )
    noise = 0.01 * np.random.default_rng(0).standard_normal((source.height, source.width))
    depth = (plane_depth(source, normal, -2.0) * (1 + noise)).astype(np.float32)
    registered = register_depth(depth, source, target)[20:-40, 20:-60]
    assert (registered == 0).mean() < 1e-3
    error = (
        registered[registered > 0]
        / plane_depth(target, normal, -2.0)[20:-40, 20:-60][registered > 0]
    )
    # Where patches overlap the nearest counts: a bias, of a share of the noise.
    assert abs(error.mean() - 1) < 3e-3
    assert error.std() < 0.015


def test_the_nearer_surface_covers_the_farther_one() -> None:
    source, target = camera(), camera(place=(0.2, 0, 0))
    depth = np.full((120, 160), 3.0, np.float32)
    depth[:, 80:] = 1.0
    registered = register_depth(depth, source, target)
    # Both shift to the left: the far by 140 * 0.2 / 3 = 9.3, the near by 28 px, and hides it.
    row = registered[60]
    assert (row[:52] == 3).all()
    assert (row[52:132] == 1).all()
    assert (row[132:] == 0).all()
    # From the other side what was hidden comes out, and nothing is known about it.
    row = register_depth(depth, source, camera(place=(-0.2, 0, 0)))[60]
    assert (row[:9] == 0).all()
    assert (row[9:89] == 3).all()
    assert (row[89:108] == 0).all()
    assert (row[108:] == 1).all()


def test_what_was_not_measured_or_is_behind_gives_nothing() -> None:
    source = camera()
    depth = np.full((120, 160), 2.0, np.float32)
    depth[40:60, 40:60] = 0
    depth[80:90, 40:60] = np.nan
    registered = register_depth(depth, source, source)
    np.testing.assert_array_equal(registered > 0, depth > 0)
    np.testing.assert_array_equal(registered[depth > 0], 2.0)
    assert (register_depth(np.zeros_like(depth), source, BESIDE) == 0).all()
    assert (register_depth(depth, source, camera(place=(0, 0, 3))) == 0).all()


def test_points_before_the_lens_take_neither_time_nor_memory() -> None:
    """No more work than others: each would otherwise cover the whole image many times."""
    depth = np.full((120, 160), 1.0, np.float32)

    def cpu_s(distance_m: float) -> float:
        """The least of several."""
        target, spent_s = camera(place=(0, 0, 1 - distance_m)), []
        for _ in range(5):
            start_s = time.thread_time()
            assert np.isfinite(register_depth(depth, camera(), target)).all()
            spent_s.append(time.thread_time() - start_s)
        return min(spent_s)

    assert cpu_s(0.015) < 20 * cpu_s(0.9)


def test_depth_of_another_size_is_rejected() -> None:
    with pytest.raises(ValueError, match=r"depth: expected .* \(120, 160\), got .* \(60, 80\)"):
        register_depth(np.ones((60, 80), np.float32), camera(), camera())


@pytest.mark.parametrize("depth_camera", [None, camera(80, 70.0)])
def test_nothing_is_measured_outside_the_mask(depth_camera: Camera | None) -> None:
    lens = camera() if depth_camera is None else depth_camera
    depth = np.full((lens.height, lens.width), 2.0, np.float32)
    mask = np.zeros((120, 160), np.bool_)
    mask[20:90, 30:140] = True
    rgb = np.zeros((120, 160, 3), np.uint8)
    frame = RgbdFrame(rgb, depth, camera(), depth_camera=depth_camera, mask=mask)
    measured = frame.registered().depth
    assert not measured[~mask].any()
    assert measured[mask].mean() > 1.5
    observed = Observation.of(frame)
    np.testing.assert_array_equal(observed.depth(), measured)
    left = np.ones_like(mask)
    left[:, 80:] = False
    np.testing.assert_array_equal(observed.with_mask(left).depth(), np.where(left, measured, 0))
