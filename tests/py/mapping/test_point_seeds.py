"""Seeds from points, for images without depth."""

from dataclasses import replace

import blob_room
import numpy as np
import pytest

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.datasets.dataset import PointCloud
from gslts.mapping.seeding.point_seeds import (
    SCALE_RANGE_PX,
    random_points_in_view,
    seed_from_points,
    spacing,
)
from gslts.mapping.seeding.triangulate import triangulate
from gslts.rendering.rasterizer import Rasterizer


@pytest.fixture(scope="module")
def frames() -> list[RgbdFrame]:
    return [blob_room.frame(camera) for camera in blob_room.cameras(6)]


def seen(camera: Camera, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return columns and rows [P,2] of points, and which are in the image."""
    pose = camera.world_from_camera
    in_camera = (points - pose[:3, 3]) @ pose[:3, :3]
    x = camera.fx * in_camera[:, 0] / in_camera[:, 2] + camera.cx
    y = camera.fy * in_camera[:, 1] / in_camera[:, 2] + camera.cy
    inside = (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
    return np.column_stack([x, y]), (in_camera[:, 2] > 0) & inside


def colors_of(gaussian_map: GaussianMap) -> np.ndarray:
    return 0.5 + SH_C0 * gaussian_map.sh[:, 0]


def test_spacing_is_the_mean_distance_to_the_next_three() -> None:
    """Compared with all distances, far from the origin."""
    points = np.random.default_rng(0).normal((1e5, -2e5, 30), 1, (500, 3))
    distances = np.sort(np.linalg.norm(points[:, None] - points, axis=2), axis=1)
    np.testing.assert_allclose(spacing(points), distances[:, 1:4].mean(axis=1), atol=1e-5)
    apart = np.linalg.norm(points[0] - points[1])
    np.testing.assert_allclose(spacing(points[:2]), [apart, apart], atol=1e-5)
    assert np.isinf(spacing(points[:1])).all()
    assert len(spacing(points[:0])) == 0


def test_no_cell_is_empty_and_colours_are_those_of_the_images(
    frames: list[RgbdFrame],
) -> None:
    cloud = triangulate(frames)
    seeds = seed_from_points(cloud, frames, sh_degree=1)
    assert seeds.sh.shape == (seeds.size, 4, 3)
    assert not seeds.sh[:, 1:].any()
    np.testing.assert_allclose(seeds.means[: len(cloud.points)], cloud.points, atol=1e-6)
    np.testing.assert_allclose(colors_of(seeds)[: len(cloud.points)], cloud.colors / 255, atol=1e-6)
    for frame in frames:
        images = Rasterizer(np.float32).forward(seeds, frame.camera)
        shape = images.alpha.shape
        cells = images.alpha[: shape[0] // 12 * 12].reshape(-1, 12, shape[1] // 12, 12)
        assert cells.mean(axis=(1, 3)).min() > 0.3
        error = np.abs(images.rgb / np.maximum(images.alpha, 0.1)[..., None] - frame.rgb / 255)
        assert error.mean() < 0.06


def test_cells_filled_by_one_image_are_known_to_the_next(frames: list[RgbdFrame]) -> None:
    cloud = triangulate(frames)
    once = seed_from_points(cloud, frames).size
    assert seed_from_points(cloud, [*frames, *frames]).size == once
    of_one = seed_from_points(cloud, frames[:1]).size
    assert once < len(cloud.points) + 3 * (of_one - len(cloud.points))
    # At depths between those that are known, near the surfaces.
    added = seed_from_points(cloud, frames).means[len(cloud.points) :].astype(np.float64)
    assert np.median(blob_room.from_planes(added)) < 0.1


def test_scales_are_bounded_by_the_resolution_of_the_nearest_image(
    frames: list[RgbdFrame],
) -> None:
    camera = frames[0].camera
    pose = camera.world_from_camera
    middle = pose[:3, 3] + 2 * pose[:3, 2]
    least_m, most_m = (limit * 2 / camera.fx for limit in SCALE_RANGE_PX)
    for count in (1, 5):  # A single point has no spacing, five at one position a spacing of 0.
        cloud = PointCloud(np.tile(middle, (count, 1)), np.full((count, 3), 128, np.uint8))
        scales_m = np.exp(seed_from_points(cloud, frames[:1]).log_scales)
        assert (scales_m == scales_m[:, :1]).all(), "they are round"
        assert scales_m.max() < 1.01 * most_m
        if count == 5:
            np.testing.assert_allclose(scales_m[:5], least_m, rtol=1e-3)


def test_masks_are_respected(frames: list[RgbdFrame]) -> None:
    mask = np.zeros(frames[0].rgb.shape[:2], np.bool_)
    mask[:, :120] = True
    frame = replace(frames[0], mask=mask)
    pose = frame.camera.world_from_camera
    cloud = PointCloud(
        (pose[:3, 3] + 2 * pose[:3, 2] - 0.3 * pose[:3, 0])[None], np.zeros((1, 3), np.uint8)
    )
    for points in (
        seed_from_points(cloud, [frame]).means,
        random_points_in_view([frame], 300).points,
    ):
        places, inside = seen(frame.camera, points.astype(np.float64))
        assert inside.all()
        assert len(places) > 100
        assert places[:, 0].max() < 120


def test_random_points_are_seen_twice_and_have_the_colours_there(
    frames: list[RgbdFrame],
) -> None:
    cloud = random_points_in_view(frames, 1000, seed=3)
    assert len(cloud.points) == 1000
    views, agree = np.zeros(1000), np.zeros(1000, np.bool_)
    for frame in frames:
        places, inside = seen(frame.camera, cloud.points)
        views += inside
        columns, rows = np.floor(places[inside]).astype(int).T
        agree[inside] |= (frame.rgb[rows, columns] == cloud.colors[inside]).all(axis=1)
    assert views.min() >= 2
    assert agree.mean() > 0.99
    again = random_points_in_view(frames, 1000, seed=3)
    assert again.points.tobytes() == cloud.points.tobytes()
    assert len(random_points_in_view(frames[:1], 50).points) == 50


def test_points_that_no_image_sees_are_rejected(frames: list[RgbdFrame]) -> None:
    pose = frames[0].camera.world_from_camera
    behind = PointCloud((pose[:3, 3] - 5 * pose[:3, 2])[None], np.zeros((1, 3), np.uint8))
    nothing = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    for cloud in (behind, nothing):
        with pytest.raises(ValueError, match="seed_from_points: no frame sees a point"):
            seed_from_points(cloud, frames[:1])
