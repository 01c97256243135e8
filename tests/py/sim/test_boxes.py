"""Tests of the decomposition of meshes into boxes, against known shapes."""

import numpy as np
import pytest
from gltf_files import box

from gslts_sim.gltf.boxes import MAX_BOXES, filling_boxes
from gslts_sim.gltf.voxels import TOUCH_M


def covered(boxes: np.ndarray, points: np.ndarray) -> np.ndarray:
    inside = (points[:, None] >= boxes[:, 0] - 1e-9) & (points[:, None] <= boxes[:, 1] + 1e-9)
    return inside.all(axis=2).any(axis=1)


def assert_same_solid(boxes: np.ndarray, parts: np.ndarray) -> None:
    """Assert that both cover the same sample points, and that the boxes do not overlap."""
    low, high = parts[:, 0].min(axis=0), parts[:, 1].max(axis=0)
    points = np.random.default_rng(0).uniform(low - 0.05, high + 0.05, (20_000, 3))
    np.testing.assert_array_equal(covered(boxes, points), covered(parts, points))
    np.testing.assert_allclose(boxes[:, 0].min(axis=0), low, atol=1e-12)
    np.testing.assert_allclose(boxes[:, 1].max(axis=0), high, atol=1e-12)
    total = (boxes[:, 1] - boxes[:, 0]).prod(axis=1).sum()
    np.testing.assert_allclose(
        total, covered(parts, points).mean() * np.prod(high - low + 0.1), rtol=0.1
    )


LEGS = [
    [[x - 0.03, y - 0.03, 0], [x + 0.03, y + 0.03, 0.71]]
    for x in (-0.55, 0.55)
    for y in (-0.35, 0.35)
]
SOLIDS = {
    "box": [[[-0.2, -0.1, 0], [0.2, 0.1, 0.3]]],
    "table": [[[-0.6, -0.4, 0.71], [0.6, 0.4, 0.75]], *LEGS],
    "sofa": [
        [[-1.1, -0.4, 0], [1.1, 0.4, 0.42]],
        [[-1.1, 0.2, 0.3], [1.1, 0.4, 0.85]],
        [[-1.1, -1.4, 0], [-0.3, -0.3, 0.42]],
    ],
    "shelf": [
        *([[-0.5, -0.15, z], [0.5, 0.15, z + 0.018]] for z in (0, 0.333, 0.7, 1.1, 1.782)),
        *([[x, -0.15, 0], [x + 0.018, 0.15, 1.8]] for x in (-0.518, 0.5)),
    ],
    "wall": [[[-2.5, -0.002, 0], [2.5, 0.002, 2.5]]],
}


@pytest.mark.parametrize("name", SOLIDS)
def test_objects_made_of_boxes_are_exact(name):
    parts = np.array(SOLIDS[name], np.float64)
    boxes = filling_boxes(np.concatenate([box(*part) for part in parts]))
    assert_same_solid(boxes, parts)
    assert len(boxes) <= len(parts) + 6


def test_table_top_is_one_box():
    boxes = filling_boxes(np.concatenate([box(*part) for part in SOLIDS["table"]]))
    np.testing.assert_allclose(boxes[0], SOLIDS["table"][0], atol=1e-12)
    assert len(boxes) == 5


def test_room_seen_from_inside_is_a_shell():
    shell = box([0, 0, 0], [5, 4, 2.6])[:, ::-1]
    boxes = filling_boxes(shell)
    assert len(boxes) == 6
    assert ((boxes[:, 1] - boxes[:, 0]).min(axis=1) == 0).all()
    middles = np.random.default_rng(0).uniform([0.01] * 3, [4.99, 3.99, 2.59], (1000, 3))
    assert not covered(boxes, middles).any()
    assert covered(boxes, shell.reshape(-1, 3)).all()


def test_room_with_thick_walls_is_hollow():
    outside, inside = box([-0.1, -0.1, -0.1], [5.1, 4.1, 2.7]), box([0, 0, 0], [5, 4, 2.6])[:, ::-1]
    boxes = filling_boxes(np.concatenate([outside, inside]))
    points = np.random.default_rng(0).uniform(-0.1, [5.1, 4.1, 2.7], (5000, 3))
    hollow = ((points > 0) & (points < [5, 4, 2.6])).all(axis=1)
    np.testing.assert_array_equal(covered(boxes, points), ~hollow)


def test_box_without_a_bottom_is_still_solid():
    corners = box([0, 0, 0], [0.4, 0.5, 0.6])
    open_below = corners[corners[:, :, 2].max(axis=1) > 0]
    np.testing.assert_allclose(filling_boxes(open_below), [[[0, 0, 0], [0.4, 0.5, 0.6]]])


def test_inclined_quad_is_a_stair_along_it():
    low, high = np.array([0.0, 0, 0]), np.array([1.0, 1, 0.5])
    quad = np.array([[[0, 0, 0], [1, 0, 0.5], [1, 1, 0.5]], [[0, 0, 0], [1, 1, 0.5], [0, 1, 0]]])
    boxes = filling_boxes(quad)
    points = np.random.default_rng(0).uniform(low, high, (5000, 3))
    distance = np.abs(points[:, 2] - 0.5 * points[:, 0])
    assert covered(boxes, points[distance < TOUCH_M]).all()
    assert not covered(boxes, points[distance > 0.15]).any()


def test_sphere_is_filled_without_bias():
    count = 24
    turn, rise = np.meshgrid(
        np.linspace(0, 2 * np.pi, 2 * count + 1), np.linspace(0, np.pi, count + 1)
    )
    grid = 0.15 * np.stack(
        [np.sin(rise) * np.cos(turn), np.sin(rise) * np.sin(turn), -np.cos(rise)], axis=-1
    )
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    corners = np.concatenate(
        [np.stack(t, axis=2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))]
    )
    boxes = filling_boxes(corners)
    assert len(boxes) <= MAX_BOXES
    volume = (boxes[:, 1] - boxes[:, 0]).prod(axis=1).sum()
    assert volume == pytest.approx(4 / 3 * np.pi * 0.15**3, rel=0.15)
    assert boxes[:, 0].min() == pytest.approx(-0.15)
    assert boxes[:, 1].max() == pytest.approx(0.15)


def test_cup_is_hollow_and_stands_on_its_bottom():
    outside, inside = (
        box([-0.04, -0.04, 0], [0.04, 0.04, 0.1]),
        box([-0.035, -0.035, 0.005], [0.035, 0.035, 0.1])[:, ::-1],
    )
    open_above = [part[part[:, :, 2].min(axis=1) < 0.1] for part in (outside, inside)]
    rim = [box([-0.04, -0.04, 0.09], [0.04, -0.035, 0.1])[-2:]]
    boxes = filling_boxes(np.concatenate(open_above + rim))
    assert not covered(boxes, np.array([[0, 0, 0.05], [0.02, 0.02, 0.09]])).any()
    assert covered(boxes, np.array([[0, 0, 0.002], [0.038, 0, 0.05]])).all()


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.0])
def test_flat_sheet_has_no_thickness(angle):
    quad = np.array(
        [[[0, 0, 0.7], [1, 0, 0.7], [1, 1, 0.7]], [[0, 0, 0.7], [1, 1, 0.7], [0, 1, 0.7]]]
    )
    turn = np.array(
        [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    boxes = filling_boxes(quad @ turn)
    np.testing.assert_array_equal(boxes[..., 2], 0.7)
    area = (boxes[:, 1] - boxes[:, 0])[:, :2].prod(axis=1).sum()
    assert area == pytest.approx(1, rel=0.15)


def test_outer_bounds_are_exact_for_any_triangles():
    rng = np.random.default_rng(3)
    for _ in range(30):
        corners = rng.normal(size=(rng.integers(1, 12), 3, 3)) * rng.uniform(0.01, 2, 3)
        boxes = filling_boxes(corners)
        np.testing.assert_array_equal(boxes[:, 0].min(axis=0), corners.min(axis=(0, 1)))
        np.testing.assert_array_equal(boxes[:, 1].max(axis=0), corners.max(axis=(0, 1)))


def test_degenerate_meshes_have_their_bounds():
    line = np.array([[[0, 0, 0], [1, 0, 0], [0.5, 0, 0]]], np.float64)
    np.testing.assert_array_equal(filling_boxes(line), [[[0, 0, 0], [1, 0, 0]]])
