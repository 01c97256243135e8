"""What one version of a map changed of another, Gaussian by Gaussian, by their ids."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import GaussianMap
from gslts.types import Bools

ARRAYS = ("means", "quats", "log_scales", "logit_opacities", "sh", "features")
"""Of a map, one row a Gaussian."""
Ids = NDArray[np.uint64]


@dataclass(frozen=True, eq=False)
class Delta:
    """The way from one map to the next.

    Attributes:
        removed: [R] ids.
        added: Gaussians that come last in the next map; their ids are higher than all before.
        changed: Gaussians that have other numbers, with their ids.
    """

    removed: Ids
    added: GaussianMap
    changed: GaussianMap

    @property
    def touched(self) -> int:
        """How many Gaussians it has to do with."""
        return len(self.removed) + self.added.size + self.changed.size


def delta_of(before: GaussianMap, after: GaussianMap) -> Delta:
    """What leads from one map to another.

    Args:
        before: Ids rise.
        after: Those that stayed, in the same order, and then new ones with higher ids.

    Raises:
        ValueError: The maps differ in more than their Gaussians, or in their order.
    """
    for name in ("dtype", "sh_degree", "feature_dims"):
        was, is_ = getattr(before, name), getattr(after, name)
        if was != is_:
            raise ValueError(f"delta_of: {name} was {was} and is {is_}")
    if not np.array_equal(before.origin, after.origin):
        raise ValueError("delta_of: the maps have different origins")
    require_rising(before, "before")
    require_rising(after, "after")
    old = np.isin(after.ids, before.ids, assume_unique=True)
    count = int(old.sum())
    if not old[:count].all() or (before.size and (after.ids[count:] <= before.ids[-1]).any()):
        raise ValueError("delta_of: after: new Gaussians must come last, and with higher ids")
    return delta_by_ids(before, after)


def delta_by_ids(before: GaussianMap, after: GaussianMap) -> Delta:
    """What is gone, new and other; what is new may have any ids.

    Args:
        before: Ids rise.
        after: Ids rise.
    """
    old = np.isin(after.ids, before.ids, assume_unique=True)
    kept = np.isin(before.ids, after.ids, assume_unique=True)
    rows, old_rows = np.flatnonzero(kept), np.flatnonzero(old)
    apart = np.zeros(len(rows), np.bool_)
    for name in ARRAYS:
        # As bits, so that -0 is not 0.
        was, is_ = (
            _bits(getattr(one, name)[of]) for one, of in ((before, rows), (after, old_rows))
        )
        apart |= was.shape != is_.shape or (was != is_).any(axis=1)
    return Delta(
        removed=before.ids[~kept],
        added=after.select(np.flatnonzero(~old)),
        changed=after.select(old_rows[apart]),
    )


def after_all(base: GaussianMap, deltas: Iterable[Delta]) -> GaussianMap:
    """A map after some changes one after another.

    Args:
        base: Ids rise.
        deltas: From the first on.

    Raises:
        ValueError: A delta has to do with a Gaussian that is not there.
    """
    steps = list(deltas)
    parts = [base, *(one.added for one in steps)]
    ids = np.concatenate([one.ids for one in parts])
    arrays = {name: np.concatenate([getattr(one, name) for one in parts]) for name in ARRAYS}
    if (ids[1:] <= ids[:-1]).any():
        raise ValueError("after_all: ids of added Gaussians must be higher than those before")
    there = np.zeros(len(ids), np.bool_)
    there[: base.size] = True
    end = base.size
    for one in steps:
        rows = _rows(ids, there, one.changed.ids)
        for name in ARRAYS:
            arrays[name][rows] = getattr(one.changed, name)
        there[_rows(ids, there, one.removed)] = False
        there[end : end + one.added.size] = True
        end += one.added.size
    kept = {name: array[there] for name, array in arrays.items()}
    return GaussianMap(**kept, ids=ids[there], origin=base.origin)


def require_rising(gaussian_map: GaussianMap, name: str) -> None:
    """Raises ValueError unless ids rise from Gaussian to Gaussian."""
    if (gaussian_map.ids[1:] <= gaussian_map.ids[:-1]).any():
        raise ValueError(f"{name}: ids must rise from Gaussian to Gaussian")


def arrays_of(gaussian_map: GaussianMap) -> dict[str, NDArray[Any]]:
    """All that a map is."""
    return {name: getattr(gaussian_map, name) for name in (*ARRAYS, "ids", "origin")}


def map_of(arrays: Mapping[str, NDArray[Any]]) -> GaussianMap:
    """The inverse of `arrays_of`.

    Raises:
        ValueError: They make no map.
    """
    try:
        return GaussianMap(**arrays)
    except TypeError as error:
        raise ValueError(f"no map: {error}") from None


def plain_delta(delta: Delta) -> dict[str, NDArray[Any]]:
    """Its arrays by name."""
    return {
        "removed": delta.removed,
        **{f"added.{name}": array for name, array in arrays_of(delta.added).items()},
        **{f"changed.{name}": array for name, array in arrays_of(delta.changed).items()},
    }


def delta_from(arrays: Mapping[str, NDArray[Any]]) -> Delta:
    """The inverse of `plain_delta`.

    Raises:
        ValueError: They make no delta.
    """
    parts: dict[str, dict[str, NDArray[Any]]] = {"added": {}, "changed": {}}
    for name, array in arrays.items():
        part, _, of = name.partition(".")
        if part in parts:
            parts[part][of] = array
    removed = arrays.get("removed")
    if removed is None or removed.dtype != np.uint64 or removed.ndim != 1:
        raise ValueError("no delta: removed: expected uint64[R]")
    return Delta(removed, map_of(parts["added"]), map_of(parts["changed"]))


def _rows(ids: Ids, there: Bools, wanted: Ids) -> NDArray[np.intp]:
    rows = np.searchsorted(ids, wanted)
    if (rows == len(ids)).any() or (ids[rows] != wanted).any() or not there[rows].all():
        raise ValueError("after_all: a delta has to do with a Gaussian that is not there")
    return rows


def _bits(array: NDArray[Any]) -> NDArray[np.uint8]:
    width = int(np.prod(array.shape[1:]))
    rows = np.ascontiguousarray(array).reshape(len(array), width)
    return rows.view(np.uint8).reshape(len(array), width * array.itemsize)
