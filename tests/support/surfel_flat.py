"""Two rooms with two doors between them, and synthetic maps of both with semantic features.

The kitchen, x from 0 to 4 m, is in the frame of the building; the map of the hall, x from 4.1 to
7.1 m, has a frame of its own. A mug is in the hall, a box in the kitchen.
"""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import flats
import numpy as np
import surfel_room

from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import inverse_transform
from gslts.semantics.files import write_autoencoder
from gslts.store.causes import SemanticsCause
from gslts.store.map_folder import open_map, write_map_folder
from gslts_sim.home import Home

DOORS = ((4.05, 0.7, 0.0), (4.05, 2.4, 0.0))
"""Middles of the doorways."""
BUILDING_FROM_HALL = np.array([[0, -1, 0, 7.0], [1, 0, 0, 0.5], [0, 0, 1, 0.25], [0, 0, 0, 1.0]])
SEEN_BEHIND_M = 0.7
"""The map of a room shows so much of the other one, through the doors."""


@cache
def home() -> Home:
    """Return the home."""
    outer = ((-0.2, -0.2, 7.3, 0), (-0.2, 3, 7.3, 3.2), (-0.2, 0, 0, 3), (7.1, 0, 7.3, 3))
    inner = ((4, 0, 4.1, 0.2), (4, 1.2, 4.1, 1.9), (4, 2.9, 4.1, 3))
    bare = flats.bare_flat((0, 0, 4.1, 3), (4.1, 0, 7.1, 3), blocks=(*outer, *inner))
    mug = surfel_room.box("Mug|1", (6.6, 2.6, 0), (6.8, 2.8, 0.3))
    crate = surfel_room.box("Box|1", (0.1, 2.5, 0), (0.5, 2.9, 0.4))
    return bare.with_object(mug).with_object(crate)


@cache
def whole() -> GaussianMap:
    """Return a map of both rooms in the frame of the building."""
    return surfel_room.surfels(home())


def room_map(low_x: float, high_x: float) -> GaussianMap:
    """Return the part of the map between two positions, m, and `SEEN_BEHIND_M` around it."""
    x = whole().means[:, 0]
    return whole().select((x > low_x - SEEN_BEHIND_M) & (x < high_x + SEEN_BEHIND_M))


def hall_map() -> GaussianMap:
    """Return the map of the hall in its frame."""
    part = room_map(4.1, 7.1)
    means = inverse_transform(BUILDING_FROM_HALL, part.means.astype(np.float64))
    turned = np.tile(np.float32([np.sqrt(0.5), 0, 0, -np.sqrt(0.5)]), (part.size, 1))
    return replace(part, means=means.astype(np.float32), quats=turned)


def write_map(gaussian_map: GaussianMap, folder: Path, *, words: bool = True) -> None:
    """Write a map whose second version has the features; without words, only the first one."""
    plain = replace(gaussian_map, features=np.zeros((gaussian_map.size, 0), np.float32))
    plain = replace(plain, ids=None)
    write_map_folder(folder, plain, {"dataset": "flat"}, {})
    if not words:
        return
    cause = SemanticsCause(
        source="oracle",
        dataset="flat",
        levels=1,
        code_dims=surfel_room.CODE_DIMS,
        names=surfel_room.NAMES,
        autoencoder=write_autoencoder(surfel_room.autoencoder(), folder),
    )
    with open_map(folder, writable=True) as store:
        store.commit_features(replace(plain, features=gaussian_map.features), cause)


def write_maps(folder: Path) -> None:
    """Write the maps of both rooms, and the transform of the hall as text."""
    write_map(room_map(0, 4), folder / "kitchen")
    write_map(hall_map(), folder / "hall")
    np.savetxt(folder / "hall.txt", BUILDING_FROM_HALL)


def write_building(folder: Path) -> Path:
    """Write the maps and the file of the building."""
    write_maps(folder)
    content = {
        "rooms": {
            "kitchen": {"map": "kitchen"},
            "hall": {"map": "hall", "building_from_map": BUILDING_FROM_HALL.tolist()},
        },
        "doors": [{"rooms": ["kitchen", "hall"], "position_m": list(door)} for door in DOORS],
    }
    (folder / "building.json").write_text(json.dumps(content))
    return folder / "building.json"
