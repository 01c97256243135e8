"""Synthetic map of rooms far apart, and updates that change a room."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from synthetic_versions import random_map

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.density.control import join
from gslts.store.causes import ChangeRecord, ExtensionCause, ExtensionRecord, UpdateCause
from gslts.store.map_folder import open_map, write_map_folder
from gslts.store.measurement_files import write_measurements
from gslts.store.measurements import Measurements
from gslts.store.records import ObjectEvent, Version
from gslts.types import Bools

ROOMS_X_M = (-40.0, -20.0, 0.0, 20.0, 40.0)
"""Centres of the rooms, x, m."""
HALF_M = 0.5
"""Half of the size of an object in the middle of a room, m."""


def write_rooms(folder: Path, size: int = 300) -> None:
    """Write the map."""
    gaussian_map = random_map(size, 0)
    middles = np.take(ROOMS_X_M, np.arange(size) % len(ROOMS_X_M))
    means = gaussian_map.means.copy()
    means[:, 0] += middles.astype(np.float32)
    write_map_folder(folder, replace(gaussian_map, means=means), {"dataset": "rooms"}, {})


def change_room(folder: Path, room: int, number: int = 0) -> Version:
    """Commit an update of the Gaussians in the middle of a room.

    Args:
        folder: Of the map.
        room: Row of `ROOMS_X_M`.
        number: Round of the update; gives other changes.
    """
    low, high = (tuple(sign * HALF_M + np.array([ROOMS_X_M[room], 0, 0])) for sign in (-1, 1))
    change = ChangeRecord(kind="addition", confidence=0.9, boxes=(None, (low, high)))
    event = ObjectEvent(kind="addition", type=f"Object {number}", boxes=change.boxes)
    cause = UpdateCause(round=number, changes=(change,))
    with open_map(folder, writable=True) as store:
        return store.commit(
            _edit(store.read(), room, number, store.version().next_id), cause, [event]
        )


def extend_room(folder: Path, room: int) -> Version:
    """Commit an extension with Gaussians in the middle of a room, and their measurements.

    Args:
        folder: Of the map.
        room: Row of `ROOMS_X_M`.
    """
    with open_map(folder, writable=True) as store:
        first_id = store.version().next_id
        extended = _with_new(store.read(), room, 0, first_id)
        new = extended.ids[extended.ids >= first_id]
        measured = Measurements(
            new, np.ones(len(new), np.bool_), np.full((len(new), 2), 0.01, np.float32)
        )
        return store.commit(extended, extension_cause(measured, folder))


def extension_cause(measured: Measurements, folder: Path) -> ExtensionCause:
    """Return the cause of an extension, and write its measurements."""
    record = ExtensionRecord(
        frames=2,
        placed=2,
        new=2,
        added=len(measured.ids),
        refined=0,
        iterations=1,
        test_psnr_db=None,
        seconds={},
    )
    return ExtensionCause(
        dataset="visit",
        record=record,
        names=(),
        frames=(),
        test_frames={},
        landmarks=None,
        measurements=write_measurements(measured, folder),
    )


def _edit(before: GaussianMap, room: int, number: int, next_id: int) -> GaussianMap:
    """Remove, move and add some Gaussians, by their ids, so that other rooms do not matter."""
    gone = _in_middle(before, room) & ((before.ids * np.uint64(7) + np.uint64(number)) % 10 < 2)
    kept = before.select(np.flatnonzero(~gone))
    means = kept.means.copy()
    means[_in_middle(kept, room) & (kept.ids % 2 == number % 2)] += np.float32(0.01)
    return _with_new(replace(kept, means=means), room, number, next_id)


def _with_new(before: GaussianMap, room: int, number: int, next_id: int) -> GaussianMap:
    """Add some Gaussians in the middle of a room."""
    new = random_map(5, number + 1)
    means = np.float32(0.1) * new.means + np.array([ROOMS_X_M[room], 0, 0], np.float32)
    return join(before, replace(new, means=means), next_id)


def _in_middle(gaussian_map: GaussianMap, room: int) -> Bools:
    return np.abs(gaussian_map.means[:, 0] - ROOMS_X_M[room]) < HALF_M
