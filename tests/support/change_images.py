"""Rendered and observed images made by hand: a wall 2 m ahead, and boxes."""

from typing import Any

import numpy as np

from gslts._core import detect as core
from gslts._core.detect import MaskRule, ObjectRule
from gslts.change.changes import Change
from gslts.change.config import GsLtsRule
from gslts.change.rules import gs_lts_change, object_changes
from gslts.core.camera import Camera, look_at

HEIGHT, WIDTH = 120, 160
WALL_M = 2.0
POSE = look_at(np.array([1.0, -2.0, 0.5]), np.array([2.0, 1.0, 0.3]))
CAMERA = Camera(fx=150, fy=160, cx=78, cy=61, width=WIDTH, height=HEIGHT, world_from_camera=POSE)
RED, BLUE = (0.9, 0.2, 0.1), (0.1, 0.2, 0.9)
RULE = ObjectRule()
Images = dict[str, np.ndarray]


def blank() -> Images:
    """Return images without a difference."""
    colors = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)
    depth = np.full((HEIGHT, WIDTH), WALL_M, np.float32)
    ones = np.ones((HEIGHT, WIDTH), np.float32)
    return {
        "observed_rgb": colors,
        "rendered_rgb": colors.copy(),
        "observed_depth": depth,
        "rendered_depth": depth.copy(),
        "alpha": ones,
        "similarity": ones.copy(),
    }


def put(
    images: Images,
    side: str,
    corner: tuple[int, int],
    size: tuple[int, int] = (24, 20),
    depth_m: float = 1.6,
    color: tuple[float, float, float] = (0.9, 0.2, 0.1),
) -> None:
    """Draw a box that faces the camera: first row and column, and height and width, px."""
    part = (slice(corner[0], corner[0] + size[0]), slice(corner[1], corner[1] + size[1]))
    images["observed_rgb" if side == "after" else "rendered_rgb"][part] = color
    images["observed_depth" if side == "after" else "rendered_depth"][part] = depth_m
    images["similarity"][part] = 0


def changes_in(
    images: Images, rule: ObjectRule = RULE, camera: Camera = CAMERA
) -> tuple[Change, ...]:
    """Return the changes that the rules find in images."""
    views = core.Views(camera=camera, **images)
    surfaces, labels = core.find_changed_surfaces(
        views, core.compute_masks(views, MaskRule()), rule
    )
    return object_changes(surfaces, labels, rule)


def gs_lts_change_at(side: str) -> Change:
    """Return the change that the strategy "gs_lts" finds where one box came or went."""
    images = blank()
    put(images, side, (40, 20 if side == "before" else 100))
    views = core.Views(camera=CAMERA, **images)
    found, labels = core.detect_gs_lts(views, core.compute_masks(views, MaskRule()), GsLtsRule())
    assert found is not None
    return gs_lts_change(found, labels)


def texture(seed: int, height: int = 90, width: int = 120) -> np.ndarray:
    """Return [H,W,3] squares of 6 x 6 px in random colours, neither dark nor bright."""
    rng = np.random.default_rng(seed)
    squares = rng.uniform(0.2, 0.8, (height // 6, width // 6, 3)).astype(np.float32)
    return squares.repeat(6, 0).repeat(6, 1)


def boxes(seed: int, height: int = 90, width: int = 120, count: int = 40) -> np.ndarray:
    """Return [H,W,3] boxes of random sizes and colours, in front of each other."""
    rng = np.random.default_rng(seed)
    image = np.full((height, width, 3), 0.5, np.float32)
    for _ in range(count):
        y, x = rng.integers(-10, (height, width))
        down, right = rng.integers(5, 30, 2)
        image[max(0, y) : max(0, y + down), max(0, x) : max(0, x + right)] = rng.random(3)
    return image


def classify(
    images: dict[str, np.ndarray], rule: ObjectRule | None = None
) -> tuple[list[Any], np.ndarray]:
    """Return the changes that `gslts._core.detect` finds, and [H,W] labels of their surfaces."""
    views = core.Views(camera=CAMERA, **images)
    masks = core.compute_masks(views, MaskRule())
    rule = ObjectRule() if rule is None else rule
    surfaces, labels = core.find_changed_surfaces(views, masks, rule)
    return core.classify_changes(surfaces, rule), labels


def at(row: float, column: float, depth_m: float) -> np.ndarray:
    """Return (3,) the point in the world at image coordinates; the first pixel's centre is 0.5."""
    x, y = (column - CAMERA.cx) / CAMERA.fx, (row - CAMERA.cy) / CAMERA.fy
    return POSE[:3, :3] @ (np.array([x, y, 1]) * depth_m) + POSE[:3, 3]
