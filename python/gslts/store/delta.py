"""Difference of two versions of a map, Gaussian by Gaussian, matched by their ids."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.edited_map import edit_map
from gslts.core.gaussian_map import GaussianMap
from gslts.store.blobs import Arrays
from gslts.types import Bools

ARRAYS = ("means", "quats", "log_scales", "logit_opacities", "sh", "features")
"""Arrays of a map with one row per Gaussian, besides `ids`."""
Ids = NDArray[np.uint64]


@dataclass(frozen=True, eq=False)
class Delta:
    """Changes that lead from one map to the next.

    Attributes:
        removed: [R] uint64 ids.
        added: New Gaussians. They come last in the next map; their ids exceed all earlier ones.
        changed: Gaussians with new values, by id.
    """

    removed: Ids
    added: GaussianMap
    changed: GaussianMap

    @property
    def touched(self) -> int:
        """Number of Gaussians that are removed, added or changed."""
        return len(self.removed) + self.added.size + self.changed.size


def compute_delta(before: GaussianMap, after: GaussianMap) -> Delta:
    """Compute the changes of an update.

    Args:
        before: With rising ids.
        after: Gaussians that stay, in the same order, then new ones with higher ids.

    Returns:
        The changes; `apply_deltas` inverts this bit by bit.

    Raises:
        ValueError: The maps differ in more than their Gaussians, or in their order.
    """
    for name in ("dtype", "sh_degree", "feature_dims"):
        old, new = getattr(before, name), getattr(after, name)
        if old != new:
            raise ValueError(f"compute_delta: {name} was {old} and is {new}")
    if not np.array_equal(before.origin, after.origin):
        raise ValueError("compute_delta: the maps have different origins")
    require_rising_ids(before, "before")
    require_rising_ids(after, "after")
    known = np.isin(after.ids, before.ids, assume_unique=True)
    count = int(known.sum())
    if not known[:count].all() or (before.size and (after.ids[count:] <= before.ids[-1]).any()):
        raise ValueError("compute_delta: after: new Gaussians must come last, with higher ids")
    return compare_by_ids(before, after)


def compare_by_ids(before: GaussianMap, after: GaussianMap) -> Delta:
    """Compare any two versions of a map; new Gaussians may have any ids.

    Args:
        before: With rising ids.
        after: With rising ids.

    Returns:
        Removed, added and changed Gaussians.
    """
    in_before = np.isin(after.ids, before.ids, assume_unique=True)
    kept = np.isin(before.ids, after.ids, assume_unique=True)
    old_rows, new_rows = np.flatnonzero(kept), np.flatnonzero(in_before)
    differs = np.zeros(len(old_rows), np.bool_)
    for name in ARRAYS:
        # As bits, so that -0 differs from 0; in words, which is faster than in bytes.
        old, new = _bits(getattr(before, name)[old_rows]), _bits(getattr(after, name)[new_rows])
        differs |= old.shape != new.shape or (old != new).any(axis=1)
    return Delta(
        removed=before.ids[~kept],
        added=after.select(np.flatnonzero(~in_before)),
        changed=after.select(new_rows[differs]),
    )


def apply_deltas(base: GaussianMap, deltas: Iterable[Delta]) -> GaussianMap:
    """Apply changes one after another.

    Args:
        base: With rising ids. Of a map that reads its chunks when they are asked for, those are
            read that hold a Gaussian of the changes.
        deltas: Oldest first.

    Returns:
        The resulting map.

    Raises:
        ValueError: A delta names a Gaussian that does not exist.
    """
    steps = list(deltas)
    if not steps:
        return base
    touched = np.unique(
        np.concatenate([ids for step in steps for ids in (step.removed, step.changed.ids)])
    )
    rows = base.rows_of_ids(touched[touched < base.next_id])
    part = _apply(base.select(rows), steps, base.next_id)
    own = part.ids < base.next_id
    stays = np.isin(touched[: len(rows)], part.ids[own], assume_unique=True)
    changed, added = part.select(np.flatnonzero(own)), part.select(np.flatnonzero(~own))
    return edit_map(base, rows[stays], changed, rows[~stays], added)


def _apply(base: GaussianMap, steps: Sequence[Delta], next_id: int) -> GaussianMap:
    """Apply changes to a part of a map that holds all Gaussians that they name."""
    parts = [base, *(step.added for step in steps)]
    new_ids = np.concatenate([step.added.ids for step in steps])
    if (new_ids[1:] <= new_ids[:-1]).any() or (new_ids[:1] < next_id).any():
        raise ValueError("apply_deltas: ids of added Gaussians must exceed those before")
    ids = np.concatenate([base.ids, new_ids])
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in ARRAYS}
    alive = np.zeros(len(ids), np.bool_)
    alive[: base.size] = True
    end = base.size
    for step in steps:
        rows = _rows_of(ids, alive, step.changed.ids)
        for name in ARRAYS:
            arrays[name][rows] = getattr(step.changed, name)
        alive[_rows_of(ids, alive, step.removed)] = False
        alive[end : end + step.added.size] = True
        end += step.added.size
    kept = {name: array[alive] for name, array in arrays.items()}
    return GaussianMap(**kept, ids=ids[alive], origin=base.origin)


def require_delta_of(delta: Delta, gaussians: int, next_id: int) -> None:
    """Check that a difference can be one from a map, as far as that can be told without the map.

    Args:
        delta: The difference.
        gaussians: Number of Gaussians of the map.
        next_id: Greater than all ids of the map.

    Raises:
        ValueError: It is one from another map.
    """
    require_rising_ids(delta.added, "added")
    for name, ids in (("removed", delta.removed), ("changed", delta.changed.ids)):
        if len(ids) > gaussians or (ids >= next_id).any():
            raise ValueError(f"commit: {name}: not all are Gaussians of the newest version")


def require_rising_ids(gaussian_map: GaussianMap, name: str) -> None:
    """Check that ids rise from Gaussian to Gaussian.

    Args:
        gaussian_map: To check.
        name: Of the argument, for the message.

    Raises:
        ValueError: They do not.
    """
    if (gaussian_map.ids[1:] <= gaussian_map.ids[:-1]).any():
        raise ValueError(f"{name}: ids must rise from Gaussian to Gaussian")


def map_to_arrays(gaussian_map: GaussianMap) -> dict[str, NDArray[Any]]:
    """Return all arrays of a map.

    Args:
        gaussian_map: Any map.

    Returns:
        The arrays by name, with `ids` and `origin`.
    """
    return {name: getattr(gaussian_map, name) for name in (*ARRAYS, "ids", "origin")}


def map_from_arrays(arrays: Arrays) -> GaussianMap:
    """Return the map of the arrays of `map_to_arrays`.

    Args:
        arrays: By name.

    Returns:
        The map.

    Raises:
        ValueError: The arrays are no map.
    """
    try:
        return GaussianMap(**arrays)
    except TypeError as error:
        raise ValueError(f"not a map: {error}") from None


def delta_to_arrays(delta: Delta) -> dict[str, NDArray[Any]]:
    """Return all arrays of a delta.

    Args:
        delta: Any delta.

    Returns:
        The arrays by name.
    """
    return {
        "removed": delta.removed,
        **{f"added.{name}": array for name, array in map_to_arrays(delta.added).items()},
        **{f"changed.{name}": array for name, array in map_to_arrays(delta.changed).items()},
    }


def delta_from_arrays(arrays: Arrays) -> Delta:
    """Return the delta of the arrays of `delta_to_arrays`.

    Args:
        arrays: By name.

    Returns:
        The delta.

    Raises:
        ValueError: The arrays are no delta.
    """
    maps: dict[str, dict[str, NDArray[Any]]] = {"added": {}, "changed": {}}
    for full_name, array in arrays.items():
        part, _, name = full_name.partition(".")
        if part in maps:
            maps[part][name] = array
    removed = arrays.get("removed")
    if removed is None or removed.dtype != np.uint64 or removed.ndim != 1:
        raise ValueError("not a delta: removed: expected uint64 [R]")
    return Delta(removed, map_from_arrays(maps["added"]), map_from_arrays(maps["changed"]))


def _rows_of(ids: Ids, alive: Bools, wanted: Ids) -> NDArray[np.intp]:
    rows = np.searchsorted(ids, wanted)
    if (rows == len(ids)).any() or (ids[rows] != wanted).any() or not alive[rows].all():
        raise ValueError("apply_deltas: a delta names a Gaussian that does not exist")
    return rows


def _bits(array: NDArray[Any]) -> NDArray[np.uint32]:
    words = prod(array.shape[1:]) * array.itemsize // 4
    return np.ascontiguousarray(array).reshape(-1).view(np.uint32).reshape(len(array), words)
