"""A simulated room, and a synthetic map of its surfaces with semantic features."""

from dataclasses import replace
from functools import cache

import numpy as np
import sim_scenes

from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.autoencoder import Autoencoder
from gslts.semantics.source import Oracle
from gslts.semantics.train_autoencoder import train_autoencoder
from gslts_sim.home import Home, HomeObject
from gslts_sim.physics import boxes_in_world

SPACING_M, THICKNESS_M = 0.05, 0.002
CODE_DIMS = 8
NAMES = ("Mug", "Box", "Block", "Wall", "Floor", "Bed")
GREY = np.full((4, 4, 3), 140, np.uint8)

Point = tuple[float, float, float]


def box(name: str, low: Point, high: Point) -> HomeObject:
    return sim_scenes.box_object(name, low, high, GREY)


@cache
def home() -> Home:
    """Return a room of 4 x 3 m with a block in the centre, a mug on it and a box in a corner."""
    plain = sim_scenes.simple_home()
    size = (4.0, 3.0, 2.6)
    walls = sim_scenes.box_object("Wall|1", (0, 0, 0), size, GREY, inward=True)
    walls = replace(walls, boxes=np.delete(walls.boxes, 4, axis=0))
    room = replace(plain.rooms[0], box=np.array([(0, 0, 0), size], float))
    return replace(
        plain,
        rooms=(room,),
        objects=(
            walls,
            box("Floor|1", (0, 0, -0.1), (4, 3, 0)),
            box("Block|1", (1.6, 0.9, 0), (2.4, 2.1, 0.75)),
            box("Mug|1", (2.2, 1.4, 0.75), (2.35, 1.55, 0.9)),
            box("Box|1", (0.1, 2.5, 0), (0.5, 2.9, 0.4)),
        ),
    )


@cache
def autoencoder() -> Autoencoder:
    """Return an autoencoder for the names of all objects."""
    return train_autoencoder(Oracle().encode(NAMES), CODE_DIMS, steps=300)


def surfels(where: Home) -> GaussianMap:
    """Return flat Gaussians on the surfaces of a home, without the outer sides of its walls."""
    means, scales, types = [], [], []
    for home_object in where.objects:
        boxes = boxes_in_world(home_object)
        for center, half in zip(boxes.centers, boxes.halves, strict=True):
            for axis in range(3):
                for side in (-1, 1):
                    own, flat = face(center, half, axis, side)
                    inside = ((own > -1e-6) & (own < where.space.box[1] + 1e-6)).all(axis=1)
                    means.append(own[inside])
                    scales.append(np.tile(flat, (inside.sum(), 1)))
                    types += [home_object.type] * int(inside.sum())
    return gaussians(np.concatenate(means), np.concatenate(scales), types)


def face(
    center: np.ndarray, half: np.ndarray, axis: int, side: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return points [P,3] on a side of a box, and the standard deviations of Gaussians there."""
    spacing_m = min(SPACING_M, half.max() / 3)  # So that small objects have enough.
    lines = [
        np.arange(-h + spacing_m / 2, h, spacing_m) if h > spacing_m / 2 else np.zeros(1)
        for h in half
    ]
    lines[axis] = np.array([side * half[axis]])
    points = center + np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    flat = np.full(3, spacing_m / 2)
    flat[axis] = THICKNESS_M
    return points, flat


def gaussians(means: np.ndarray, scales: np.ndarray, types: list[str]) -> GaussianMap:
    """Return opaque Gaussians with the features of their types; type "" has none."""
    size = len(means)
    codes = autoencoder().encode(Oracle().encode(NAMES))
    rows = np.array([NAMES.index(name) if name else -1 for name in types])
    features = np.where(rows[:, None] >= 0, codes[rows], 0)
    return GaussianMap(
        means=means.astype(np.float32),
        quats=np.tile(np.float32([1, 0, 0, 0]), (size, 1)),
        log_scales=np.log(scales).astype(np.float32),
        logit_opacities=np.full(size, 4, np.float32),
        sh=np.zeros((size, 1, 3), np.float32),
        features=features.astype(np.float32),
    )


@cache
def surfel_map() -> GaussianMap:
    """Return the map of `home`."""
    return surfels(home())


def concatenate(first: GaussianMap, second: GaussianMap) -> GaussianMap:
    names = ("means", "quats", "log_scales", "logit_opacities", "sh", "features")
    return GaussianMap(
        **{name: np.concatenate([getattr(first, name), getattr(second, name)]) for name in names}
    )
