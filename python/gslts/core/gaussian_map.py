"""Gaussian maps: arrays of 3D Gaussians with ids that persist through edits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from math import isqrt, pi, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gslts._core.map import CHUNK_SIZE, ChunkBounds, GaussianViewDouble, GaussianViewFloat
from gslts.core.chunks import ChunkMemory, Chunks
from gslts.core.id_runs import IdRuns
from gslts.types import Bools, Floats, Indices, UInts64

SH_C0 = 0.5 / sqrt(pi)
"""Value of the constant spherical harmonic: the colour of SH degree 0 is 0.5 + SH_C0 * sh."""

MIN_BOUNDED = 1 << 16
"""Minimum number of Gaussians of a map with an index by which rendering skips those out of view: a
smaller one, of 16 chunks, gains little."""

FloatArray = NDArray[np.float32] | NDArray[np.float64]

ROW_ARRAYS = ("means", "quats", "log_scales", "logit_opacities", "sh", "features", "ids")
"""Arrays of a map with a row per Gaussian."""
_ARRAYS = (*ROW_ARRAYS, "origin")
"""Arrays of a map."""
_VIEW_TYPES: dict[np.dtype[Any], type[GaussianViewFloat] | type[GaussianViewDouble]] = {
    np.dtype(np.float32): GaussianViewFloat,
    np.dtype(np.float64): GaussianViewDouble,
}
"""View of the core by dtype of a map."""


def _absent() -> Any:
    """Return the default of an array, None; `GaussianMap.__post_init__` replaces it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GaussianMap:
    """N Gaussians as arrays, all of one dtype, float32 or float64, and checked on construction.

    Stored values are unconstrained, as 3DGS optimises them: scale = exp(log_scale), opacity =
    sigmoid(logit_opacity), `rotation = quat / |quat|`. The map holds its arrays read-only and
    without a copy where they are C-contiguous: do not write into them elsewhere while the map is in
    use.

    A large map from a store reads its Gaussians, a chunk of some thousands at a time, when they are
    asked for: by a rendering, by `select`, `part` and `centers`, or all of them by an array such as
    `means`. All of these may raise OSError or ValueError then, for a file that is damaged.

    Args:
        means: [N,3] centres, m, relative to `origin`, world axes.
        quats: [N,4] wxyz, rotations from the Gaussian's axes to the map's; any length, and no
            rotation below 1e-12.
        log_scales: [N,3] log of the standard deviations in m.
        logit_opacities: [N].
        sh: [N,K,3] spherical harmonics of degree 0 to 3, K = (degree + 1)^2; RGB colour =
            max(0, 0.5 + SH(direction from the camera to the centre)).
        features: [N,D] semantic features; D = 0 by default.
        ids: [N] uint64, unique, never used again once removed; 0, 1, ... by default.
        origin: (3,) float64, map origin in the world, m; zero by default. A map far from the
            world's origin keeps its full resolution in float32.

    Attributes:
        bounds: Index by which rendering skips Gaussians out of view: bounds of runs of Gaussians
            that follow each other in the arrays, see `gslts.mapping.order`. None for a small map.

    Raises:
        TypeError: An argument is no numpy array.
        ValueError: An array has a wrong shape or dtype, or holds a number that is not finite (the
            message names the array and the index of its first), or an id occurs twice.
    """

    means: FloatArray
    quats: FloatArray
    log_scales: FloatArray
    logit_opacities: FloatArray
    sh: FloatArray
    # Without defaults in the class, `__getattr__` is called for arrays that were not read.
    features: FloatArray = field(default_factory=_absent)
    ids: NDArray[np.uint64] = field(default_factory=_absent)
    origin: NDArray[np.float64] = field(default_factory=_absent)
    bounds: ChunkBounds | None = field(default=None, init=False, repr=False)
    _memory: ChunkMemory | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        means = _read_only("means", self.means)
        size = means.shape[0] if means.ndim > 0 else 0
        defaults: dict[str, NDArray[Any]] = {
            "features": np.zeros((size, 0), means.dtype),
            "ids": np.arange(size, dtype=np.uint64),
            "origin": np.zeros(3),
        }
        for name in _ARRAYS:
            value = getattr(self, name)
            if value is None:
                value = defaults.get(name)
            object.__setattr__(self, name, _read_only(name, value))
        view = self.view()  # Checks shapes and dtypes.
        if self.size >= MIN_BOUNDED:
            object.__setattr__(self, "bounds", view.chunk_bounds("GaussianMap"))
        else:
            view.require_finite("GaussianMap")
        _check_ids(self.ids, size)

    @classmethod
    def of_chunks(cls, chunks: Chunks, origin: Floats) -> GaussianMap:
        """Return a map that reads its chunks when they are asked for.

        Args:
            chunks: Of at least `MIN_BOUNDED` Gaussians.
            origin: (3,) map origin in the world, m.
        """
        return cls._of_memory(ChunkMemory(chunks), origin)

    @classmethod
    def _of_memory(cls, memory: ChunkMemory, origin: Floats) -> GaussianMap:
        result = object.__new__(cls)
        result.__dict__.update(origin=origin, bounds=memory.bounds(), _memory=memory)
        return result

    if not TYPE_CHECKING:  # All attributes are known to it.

        def __getattr__(self, name: str) -> Any:
            """Return an array of a map that reads its chunks when asked, after all are read."""
            if name not in _ARRAYS or self.__dict__.get("_memory") is None:
                raise AttributeError(f"GaussianMap has no attribute {name}")
            self._memory.load_all(features=name == "features")
            return _read_only(name, self._memory.arrays[name])

    def __getstate__(self) -> dict[str, NDArray[Any]]:
        return {name: getattr(self, name) for name in _ARRAYS}  # A copy has all in memory.

    def __setstate__(self, state: dict[str, NDArray[Any]]) -> None:
        GaussianMap.__init__(self, **state)

    def __repr__(self) -> str:
        return (
            f"GaussianMap(size={self.size}, dtype={self.dtype}, sh_degree={self.sh_degree}, "
            f"feature_dims={self.feature_dims}, origin={tuple(self.origin.tolist())})"
        )

    @property
    def size(self) -> int:
        """Number of Gaussians, N."""
        return len(self._stored("means"))

    @property
    def dtype(self) -> np.dtype[Any]:
        """float32 or float64."""
        return self._stored("means").dtype

    @property
    def nbytes(self) -> int:
        """Bytes of the arrays in memory, and on the disk but for headers."""
        return sum(self._stored(name).nbytes for name in ROW_ARRAYS) + self.origin.nbytes

    @property
    def sh_degree(self) -> int:
        """Degree of the spherical harmonics, 0 to 3."""
        return isqrt(self._stored("sh").shape[1]) - 1

    @property
    def feature_dims(self) -> int:
        """Length of a feature vector, D."""
        return int(self._stored("features").shape[1])

    @property
    def next_id(self) -> int:
        """Number greater than all ids of the map."""
        if self._memory is not None:
            return self._memory.chunks.ids.next_id
        return int(self.ids.max()) + 1 if self.size else 0

    @property
    def chunks(self) -> Chunks | None:
        """Chunks that are read when they are asked for; None if the map is in memory."""
        return None if self._memory is None else self._memory.chunks

    def view(self, *, whole: bool = True) -> GaussianViewFloat | GaussianViewDouble:
        """Return the map as the C++ core takes it, without a copy; it keeps the arrays alive.

        Args:
            whole: Read all Gaussians. Renderers need not: they load what they read.
        """
        if whole and self._memory is not None:
            self._memory.load_all()
        if self.dtype not in _VIEW_TYPES:
            raise ValueError(f"means: expected dtype float32 or float64, got {self.dtype}")
        bounds: Any = self.bounds  # The core takes a null pointer, too; its stub does not say so.
        return _VIEW_TYPES[self.dtype](
            means=self._stored("means"),
            quats=self._stored("quats"),
            log_scales=self._stored("log_scales"),
            logit_opacities=self._stored("logit_opacities"),
            sh=self._stored("sh"),
            features=self._stored("features"),
            origin=self.origin,
            bounds=bounds,
        )

    def rows_in_box(self, low: Floats, high: Floats) -> Indices:
        """Return all Gaussians with centres in a box, and others: whole chunks near it.

        Args:
            low: (3,) corner, world, m.
            high: (3,) opposite corner, world, m.

        Returns:
            [M] rows, ascending; all rows of a small map.
        """
        if self.bounds is None:
            return np.arange(self.size)
        boxes = self.bounds.boxes() + self.origin
        near = ((boxes[:, 0] <= high) & (boxes[:, 1] >= low)).all(axis=1)
        return self.rows_of_chunks(np.flatnonzero(near))

    def rows_of_chunks(self, chunks: NDArray[Any]) -> Indices:
        """Return the Gaussians of chunks of `bounds`.

        Args:
            chunks: [C] chunks, ascending.

        Returns:
            [M] rows, ascending.
        """
        rows: Indices = chunks.astype(np.intp)[:, None] * CHUNK_SIZE + np.arange(CHUNK_SIZE)
        return rows[rows < self.size]

    def parts(self) -> Iterator[tuple[slice, GaussianMap]]:
        """Yield the whole map in parts of some thousand Gaussians, with their rows.

        What was not read from the disk before is not kept in memory.
        """
        for first in range(0, self.size, CHUNK_SIZE):
            rows = slice(first, min(first + CHUNK_SIZE, self.size))
            if self._memory is None:
                yield rows, self.part(rows)
            else:
                yield rows, self._of_arrays(self._memory.peek(first // CHUNK_SIZE))

    def part(self, rows: slice) -> GaussianMap:
        """Return consecutive Gaussians; it costs no copy and no check.

        Args:
            rows: First row, and the row after the last.
        """
        self._load(np.arange(rows.start, rows.stop))
        return self._of_arrays({name: self._stored(name)[rows] for name in ROW_ARRAYS})

    def _of_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> GaussianMap:
        """Return a map of arrays that were checked before."""
        result = object.__new__(GaussianMap)
        views = {name: _read_only(name, array) for name, array in arrays.items()}
        result.__dict__.update(views, origin=self.origin)
        return result

    def centers(self, rows: NDArray[Any]) -> Floats:
        """Return centres of Gaussians in the world.

        Args:
            rows: [M] rows.

        Returns:
            [M,3] m.
        """
        self._load(rows, features=False)
        centers: Floats = self._stored("means")[rows] + self.origin
        return centers

    def rows_of_ids(self, ids: UInts64) -> Indices:
        """Return the rows of Gaussians of a map whose ids rise.

        Args:
            ids: [M] of the Gaussians.

        Returns:
            [M] rows.

        Raises:
            ValueError: A Gaussian is not in the map.
        """
        rows, found = self._find_ids(ids)
        if not found.all():
            raise ValueError(f"GaussianMap: there is no Gaussian with the id {ids[~found][0]}")
        return rows

    def has_ids(self, ids: UInts64) -> Bools:
        """Return which Gaussians are in a map whose ids rise.

        Args:
            ids: [M] of Gaussians.

        Returns:
            [M] True for those of the map.
        """
        return self._find_ids(ids)[1]

    def with_features(self, features_of: Callable[[UInts64], FloatArray]) -> GaussianMap:
        """Return the map with other features; it costs no copy and no check of the other arrays.

        Args:
            features_of: Returns the features [M,D] of Gaussians by their ids [M], in the dtype of
                the map; called for those that are read.

        Raises:
            ValueError: The array has another shape or dtype, or holds a number that is not finite.
        """

        def checked(ids: UInts64) -> FloatArray:
            features = features_of(ids)
            if features.dtype != self.dtype or features.ndim != 2 or len(features) != len(ids):
                raise ValueError(
                    f"GaussianMap: features: expected {self.dtype} ({len(ids)}, D), got "
                    f"{features.dtype} {features.shape}"
                )
            if not np.isfinite(features).all():
                raise ValueError("GaussianMap: features: must be finite")
            return features

        if self._memory is not None:
            return self._of_memory(self._memory.with_features(checked), self.origin)
        result = object.__new__(GaussianMap)
        result.__dict__.update(self.__dict__, features=_read_only("features", checked(self.ids)))
        return result

    def without_features(self) -> GaussianMap:
        """Return the map without features, which renders in half the time; it costs no copy."""
        return self.with_features(lambda ids: np.zeros((len(ids), 0), self.dtype))

    def astype(self, dtype: DTypeLike) -> GaussianMap:
        """Return the map in another dtype; ids and origin do not change.

        Args:
            dtype: float32 or float64.

        Raises:
            ValueError: The dtype is neither.
        """
        arrays = {name: getattr(self, name) for name in ROW_ARRAYS}
        floats = {name: array.astype(dtype) for name, array in arrays.items() if name != "ids"}
        return GaussianMap(**arrays | floats, origin=self.origin)

    def select(self, rows: NDArray[Any]) -> GaussianMap:
        """Return a map of some of the Gaussians, with their ids.

        Args:
            rows: [M] indices, each at most once, in the order of the result; or [N] bool.

        Raises:
            ValueError: An index occurs twice, or `rows` is neither.
            IndexError: An index is out of range.
        """
        rows = np.asarray(rows)
        if rows.ndim != 1 or rows.dtype.kind not in "iub":
            raise ValueError(
                f"rows: expected [M] integers or [N] bool, got {rows.dtype} {rows.shape}"
            )
        self._load(rows)
        arrays = {name: self._stored(name)[rows] for name in ROW_ARRAYS}
        return GaussianMap(**arrays, origin=self.origin)

    def _stored(self, name: str) -> NDArray[Any]:
        """Return an array in which chunks that were not read are zero."""
        arrays = self.__dict__ if self._memory is None else self._memory.arrays
        array: NDArray[Any] = arrays[name]
        return array

    def _load(self, rows: NDArray[Any], *, features: bool = True) -> None:
        """Read the chunks of some rows."""
        if self._memory is not None:
            rows = np.flatnonzero(rows) if rows.dtype.kind == "b" else rows % self.size
            self._memory.load(self._memory.chunks.of_rows(rows), features=features)

    def _find_ids(self, ids: UInts64) -> tuple[Indices, Bools]:
        """Return the rows [M] of Gaussians by their ids, and True for those that are there."""
        return (IdRuns.of(self.ids) if self.chunks is None else self.chunks.ids).find(ids)


def _read_only(name: str, array: Any) -> NDArray[Any]:
    """Return a read-only view of the array; of a copy if it is not C-contiguous and aligned."""
    if not isinstance(array, np.ndarray):
        raise TypeError(f"{name}: expected a numpy array, got {type(array).__name__}")
    result = np.require(array, requirements=["C", "ALIGNED", "ENSUREARRAY"]).view()
    result.flags.writeable = False
    return result


def _check_ids(ids: NDArray[Any], size: int) -> None:
    if ids.dtype != np.uint64 or ids.shape != (size,):
        raise ValueError(f"ids: expected uint64 ({size},), got {ids.dtype} {ids.shape}")
    ascending = ids if np.all(ids[1:] > ids[:-1]) else np.sort(ids)
    repeated = np.flatnonzero(ascending[1:] == ascending[:-1])
    if len(repeated) > 0:
        raise ValueError(f"ids: {ascending[repeated[0]]} occurs more than once")
