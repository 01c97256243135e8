"""A simulated room and a map of it that is made up of its boxes, in which Gaussians know words."""

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

APART_M, THIN_M = 0.05, 0.002
CODE = 8
NAMES = ("Mug", "Box", "Block", "Wall", "Floor", "Bed")
GREY = np.full((4, 4, 3), 140, np.uint8)

Point = tuple[float, float, float]


def thing(name: str, low: Point, high: Point) -> HomeObject:
    return sim_scenes.box_object(name, low, high, GREY)


@cache
def home() -> Home:
    """A room of 4 x 3 m with a block in its middle, a mug on it and a box in a corner."""
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
            thing("Floor|1", (0, 0, -0.1), (4, 3, 0)),
            thing("Block|1", (1.6, 0.9, 0), (2.4, 2.1, 0.75)),
            thing("Mug|1", (2.2, 1.4, 0.75), (2.35, 1.55, 0.9)),
            thing("Box|1", (0.1, 2.5, 0), (0.5, 2.9, 0.4)),
        ),
    )


@cache
def autoencoder() -> Autoencoder:
    """Of the names of all things."""
    return train_autoencoder(Oracle().encode(NAMES), CODE, steps=300)


def surfels(where: Home) -> GaussianMap:
    """Flat Gaussians all over the boxes of a home, but for the outer sides of its walls."""
    means, scales, types = [], [], []
    for one in where.objects:
        boxes = boxes_in_world(one)
        for center, half in zip(boxes.centers, boxes.halves, strict=True):
            for axis in range(3):
                for side in (-1, 1):
                    own, flat = face(center, half, axis, side)
                    inside = ((own > -1e-6) & (own < where.space.box[1] + 1e-6)).all(axis=1)
                    means.append(own[inside])
                    scales.append(np.tile(flat, (inside.sum(), 1)))
                    types += [one.type] * int(inside.sum())
    return gaussians(np.concatenate(means), np.concatenate(scales), types)


def face(
    center: np.ndarray, half: np.ndarray, axis: int, side: int
) -> tuple[np.ndarray, np.ndarray]:
    """Points [P,3] on a side of a box, and the standard deviations of Gaussians there."""
    apart_m = min(APART_M, half.max() / 3)  # Small things have enough Gaussians, too.
    lines = [
        np.arange(-h + apart_m / 2, h, apart_m) if h > apart_m / 2 else np.zeros(1) for h in half
    ]
    lines[axis] = np.array([side * half[axis]])
    points = center + np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    flat = np.full(3, apart_m / 2)
    flat[axis] = THIN_M
    return points, flat


def gaussians(means: np.ndarray, scales: np.ndarray, types: list[str]) -> GaussianMap:
    """Opaque Gaussians that know what they are; those of type "" do not."""
    size = len(means)
    codes = autoencoder().encode(Oracle().encode(NAMES))
    rows = np.array([NAMES.index(one) if one else -1 for one in types])
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
    """Of `home`."""
    return surfels(home())


def joined(one: GaussianMap, other: GaussianMap) -> GaussianMap:
    names = ("means", "quats", "log_scales", "logit_opacities", "sh", "features")
    return GaussianMap(
        **{name: np.concatenate([getattr(one, name), getattr(other, name)]) for name in names}
    )
