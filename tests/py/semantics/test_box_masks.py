"""Masks of objects in boxes, on drawn scenes."""

import numpy as np
import pytest

from gslts.core.camera import Camera, camera_from_fov, look_at
from gslts.semantics.box_masks import box_mask

WIDTH, HEIGHT = 160, 120
TABLE, CUP = (150, 110, 70), (230, 230, 235)


def camera() -> Camera:
    """Return a camera 0.5 m above a table, 1 m from the cup."""
    return camera_from_fov(WIDTH, HEIGHT, 0.8, look_at((0, -1, 0.5), (0, 0, 0)))


def scene(height_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return colours, depth and the true mask of a cylinder of radius 0.08 m on a table."""
    view = camera()
    rng = np.random.default_rng(0)
    columns, rows = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    rays = np.stack(
        [(columns - view.cx) / view.fx, (rows - view.cy) / view.fy, np.ones_like(rows)], axis=-1
    )
    pose = view.world_from_camera
    directions, eye = rays @ pose[:3, :3].T, pose[:3, 3]
    depth = -eye[2] / directions[..., 2]
    mask = np.zeros((HEIGHT, WIDTH), bool)
    for level in np.linspace(0, height_m, 60):  # Slices of the cylinder.
        z = (level - eye[2]) / directions[..., 2]
        points = eye + directions * z[..., None]
        inside = (np.hypot(points[..., 0], points[..., 1]) < 0.08) & (z > 0)
        depth = np.where(inside, np.minimum(depth, z), depth)
        mask |= inside
    colors = np.where(mask[..., None], CUP, TABLE) + rng.integers(-8, 8, (HEIGHT, WIDTH, 3))
    noisy = depth + rng.normal(0, 0.002, depth.shape)
    return colors.clip(0, 255).astype(np.uint8), noisy.astype(np.float32), mask


def box_of(mask: np.ndarray, margin: int = 2) -> np.ndarray:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    corners = (columns[0] - margin, rows[0] - margin, columns[-1] + margin, rows[-1] + margin)
    return np.array(corners, np.float32)


def iou(found: np.ndarray, mask: np.ndarray) -> float:
    return float((found & mask).sum() / (found | mask).sum())


@pytest.mark.parametrize("height_m", [0.12, 0.0])
def test_the_table_below_an_object_is_not_part_of_it(height_m: float) -> None:
    """A cup stands out by its depth, a flat thing by its colour."""
    rgb, depth, mask = scene(height_m)
    found = box_mask(rgb, depth, camera(), box_of(mask, margin=6))
    assert iou(found, mask) > 0.85


def test_depth_separates_what_has_the_color_of_the_table() -> None:
    rgb, depth, mask = scene(0.12)
    rgb[:] = TABLE
    assert iou(box_mask(rgb, depth, camera(), box_of(mask)), mask) > 0.75


def test_color_separates_where_nothing_was_measured() -> None:
    rgb, depth, mask = scene(0.12)
    found = box_mask(rgb, np.zeros_like(depth), camera(), box_of(mask, margin=6))
    assert iou(found, mask) > 0.85


def test_masks_are_repeatable_and_within_the_box() -> None:
    rgb, depth, mask = scene(0.12)
    box = box_of(mask)
    found = box_mask(rgb, depth, camera(), box)
    np.testing.assert_array_equal(found, box_mask(rgb, depth, camera(), box))
    left, top, right, bottom = box.astype(int)
    found[top:bottom, left:right] = False
    assert not found.any()


@pytest.mark.parametrize(
    "box",
    [
        (0, 0, 160, 120),
        (159.6, 119.6, 160, 120),
        (0, 0, 0.2, 0.2),
        (-9, 50, 3, 200),
        (0, 60, 160, 61),
    ],
)
def test_any_box_has_a_mask(box: tuple[float, ...]) -> None:
    rgb, depth, _ = scene(0.12)
    depth[:, ::2] = np.nan
    assert box_mask(rgb, depth, camera(), np.array(box, np.float32)).any()
