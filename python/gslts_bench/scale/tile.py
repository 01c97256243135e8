"""Large maps: copies of a room side by side, on one floor."""

from __future__ import annotations

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.types import Floats, UInts64

WALL_M = 0.3
"""Distance of the copies, as of rooms with walls between."""
OUTLIERS_PERCENT = 0.5
"""Share of the Gaussians of a room that may reach into the next one, at each of its sides."""


def tile_room(room: GaussianMap, count: int) -> GaussianMap:
    """Surround a room by copies of it.

    Args:
        room: Map of one room.
        count: Number of rooms, at least 1.

    Returns:
        The rooms on a grid, in a spiral around the first one, which is the room itself, with its
        ids.
    """
    low, high = np.percentile(room.means, [OUTLIERS_PERCENT, 100 - OUTLIERS_PERCENT], axis=0)
    offsets = _offsets(count) * (high - low + WALL_M)
    names = ("quats", "log_scales", "logit_opacities", "sh", "features")
    return GaussianMap(
        means=np.concatenate([room.means + offset.astype(room.dtype) for offset in offsets]),
        **{name: np.concatenate([getattr(room, name)] * count) for name in names},
        ids=_ids(room, count),
        origin=room.origin,
    )


def _offsets(count: int) -> Floats:
    """Return [count,3] places on a grid of edge 1, along a spiral: each beside the one before."""
    places, place, step = [np.zeros(3)], np.zeros(3), np.array([1.0, 0.0, 0.0])
    length = 1
    while len(places) < count:
        for _ in range(2):
            for _ in range(length):
                place = place + step
                places.append(place)
            step = np.array([-step[1], step[0], 0.0])
        length += 1
    return np.array(places[:count])


def _ids(room: GaussianMap, count: int) -> UInts64:
    first = int(room.ids.max()) + 1
    others = np.arange(first, first + (count - 1) * room.size, dtype=np.uint64)
    return np.concatenate([room.ids, others])
