"""Two rooms of random Gaussians, and clones of their map that robots change."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from store_maps import random_map

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.density.control import join
from gslts.store.causes import Box, ChangeRecord, UpdateCause
from gslts.store.map_folder import open_map, write_map_folder
from gslts.store.records import ObjectEvent, Version

ROOMS_X_M = (-20.0, 20.0)
"""Centres of the rooms, x, m."""


def write_rooms(folder: Path, size: int = 200) -> None:
    """Write a map of two rooms."""
    gaussian_map = random_map(size)
    means = gaussian_map.means.copy()
    means[:, 0] += np.where(np.arange(size) % 2, *ROOMS_X_M)
    write_map_folder(folder, replace(gaussian_map, means=means), {"dataset": "rooms"}, {})


def change_room(folder: Path, room: int, seed: int = 0, robot: str = "r1") -> Version:
    """Commit an update in a room: some Gaussians near its middle are removed, moved and added."""
    with pytest.MonkeyPatch.context() as patch, open_map(folder, writable=True) as store:
        patch.setenv("GSLTS_ROBOT", robot)
        before = store.read()
        change = addition_in(room, before)
        cause = UpdateCause(round=seed, changes=(change,))
        event = ObjectEvent(kind="addition", type=f"Mug-{seed}", boxes=change.boxes)
        return store.commit(edited_in(before, room, seed, store.version().next_id), cause, [event])


def edited_in(before: GaussianMap, room: int, seed: int, next_id: int) -> GaussianMap:
    """Return the map after an edit of Gaussians near the middle of a room."""
    near = np.abs(before.means[:, 0] - ROOMS_X_M[room]) < 0.5
    chance = (before.ids * 7 + seed) % 10  # By id, so that other rooms do not matter.
    kept = before.select(np.flatnonzero(~near | (chance > 1)))
    near = np.abs(kept.means[:, 0] - ROOMS_X_M[room]) < 0.5
    means = kept.means.copy()
    means[near & (kept.ids % 2 == seed % 2)] += np.float32(0.01)
    new = replace(random_map(5, seed), origin=before.origin)
    new = replace(new, means=0.1 * new.means + np.float32([ROOMS_X_M[room], 0, 0]))
    return join(replace(kept, means=means), new, next_id)


def addition_in(room: int, gaussian_map: GaussianMap) -> ChangeRecord:
    """Return the addition of an object in the middle of a room."""
    middle = gaussian_map.origin + np.array([ROOMS_X_M[room], 0, 0])
    box: Box = (tuple((middle - 0.5).tolist()), tuple((middle + 0.5).tolist()))
    return ChangeRecord(kind="addition", confidence=0.9, boxes=(None, box))
