"""The versions of a map as the pages show them: read once for all pages."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot_body import RobotBody
from gslts.io.image_files import image_size, read_rgb, shrink_image
from gslts.io.images import RgbImage
from gslts.navigation.semantic_map import SemanticMap, make_semantic_map
from gslts.navigation.terrain import Terrain
from gslts.navigation.viewpoints import Target
from gslts.semantics.categories import classify_gaussians
from gslts.semantics.files import read_semantics
from gslts.semantics.queries import Instance, SemanticQueries
from gslts.semantics.registry import open_text_source
from gslts.semantics.source import Codec
from gslts.semantics.vocabulary import NOUNS
from gslts.store.camera_files import cameras_of_store
from gslts.store.causes import Box
from gslts.store.describe import describe_event, describe_version, describe_versions, format_made
from gslts.store.history import open_history
from gslts.store.manifest import update_image_path
from gslts.store.map_folder import open_map
from gslts.store.records import Track, TrackEvent, Version
from gslts.types import Floats
from gslts.viewer.blocks import Block, Cell, block_edge_m, make_blocks
from gslts.viewer.picking import PICK_RADIUS_M, contains, volume_m3

if TYPE_CHECKING:
    from gslts.navigation.planner import PlannedPath

Value = TypeVar("Value")

CACHED_VERSIONS = 3
"""Number of versions in memory: two that are compared, and the newest. A map of 500,000 Gaussians
takes 100 MB with its blocks."""
DEFAULT_FOV_RAD = 1.0
"""Vertical field of view of the pages of a map without cameras, rad."""
MAX_IMAGE_BYTES, MAX_SIDE_PX = 4 << 20, 8192
"""Maximum size of the file of the image of an update, and of its sides; usual ones take some 100 kB
and are 1200 px wide."""
MAX_IMAGE_PX = 480
"""Width to which it is reduced, px: the panel is 345 wide. In a small room, the whole image would
be most of what a new version sends."""
ARRIVAL_M = 1.0
"""Distance from an object at which a path to it ends, m, as that of `gslts go`."""


@dataclass(frozen=True, eq=False)
class Semantics:
    """Words of a version of a map.

    Attributes:
        codec: Decodes the features.
        names: Words that an object can be called by.
        queries: Queries on the map.
    """

    codec: Codec
    names: tuple[str, ...]
    queries: SemanticQueries


def outside_view(gaussian_map: GaussianMap) -> tuple[Floats, Floats]:
    """Choose a view of a whole map, from above and outside.

    Args:
        gaussian_map: Also an empty one.

    Returns:
        (3,) position and (3,) target, relative to the origin of the map, m.
    """
    means = gaussian_map.means.astype(np.float64)
    middle, size_m = (means.mean(axis=0), means.std()) if len(means) else (np.zeros(3), 1.0)
    return middle + size_m * np.array([0.0, -4.0, 2.0]), middle


class ViewedMap:
    """Versions of one map, for pages in several threads.

    Args:
        folder: Folder of the map.
        clip: Folder of the CLIP of its semantics, if it was moved.

    Attributes:
        name: Name of the folder.
        versions: All versions, oldest first.
        lines: Object changes in words, by number of the version.
        replaced: Number of times that a pull replaced versions by those of others.
        origin: (3,) origin of the map in the world, m: that of the pages.

    Raises:
        OSError: The map cannot be read.
        ValueError: The folder holds no map.
    """

    def __init__(self, folder: Path, clip: Path | None = None) -> None:
        self._folder, self._clip = folder, clip
        self._query_lock = threading.Lock()  # The models are not made for several threads.
        self.name = folder.resolve().name
        self.versions: list[Version] = []
        self.lines: dict[int, list[str]] = {}
        self.replaced = 0
        self.gaussians: Callable[[int], GaussianMap] = self._cached(self._read, CACHED_VERSIONS)
        self._blocks = self._cached(self._make_blocks, CACHED_VERSIONS)
        self._semantics = self._cached(self._open_semantics, 1)
        self._plan = self._cached(self._make_plan, 1)
        self.refresh()
        newest = self.gaussians(self.newest)
        self.origin, self._edge_m = newest.origin, block_edge_m(newest)

    @property
    def newest(self) -> int:
        """Number of the newest version."""
        return self.versions[-1].number

    def refresh(self) -> bool:
        """Read the history again if there are new versions, or others than before.

        Returns:
            True if there are.

        Raises:
            OSError: The map cannot be read.
            ValueError: It is damaged.
        """
        with open_history(self._folder) as store:
            # What replaces an earlier version changes ids and counts of those after it, too.
            if self.versions and store.version() == self.versions[-1]:
                return False
            lines, versions = describe_versions(store), store.versions()
        self.replaced += _contents(self.versions) != _contents(versions[: len(self.versions)])
        self.lines, self.versions = lines, versions  # In this order: pages read them meanwhile.
        return True

    def describe(self, number: int) -> list[str]:
        """Describe a version.

        Args:
            number: Of the version.

        Returns:
            When and by whom it was made, why, and a line for each object change.
        """
        version = self.versions[number - 1]
        return [format_made(version), describe_version(version), *self.lines.get(number, [])]

    def blocks(self, number: int) -> dict[Cell, Block]:
        """Return the Gaussians of a version in blocks.

        Args:
            number: Of the version.

        Raises:
            OSError: A file is missing or cannot be read.
            ValueError: The version is damaged or was compacted.
        """
        return self._blocks(number)

    def cameras(self, number: int) -> list[Camera]:
        """Return the cameras of the frames that led to a version.

        Args:
            number: Of the version.
        """
        with open_history(self._folder) as store:
            return list(cameras_of_store(store, number).values())

    def first_view(self) -> tuple[Floats, Floats, float]:
        """Return from where a page looks first: as the first camera does, or from outside.

        Returns:
            (3,) position and (3,) target, relative to the origin of the map, m; and the vertical
            field of view, rad.
        """
        cameras = self.cameras(self.newest)
        if cameras:
            pose, camera = cameras[0].world_from_camera, cameras[0]
            position = pose[:3, 3] - self.origin
            fov_rad = 2 * float(np.arctan(camera.height / 2 / camera.fy))
            return position, position + 2 * pose[:3, 2], fov_rad
        return *outside_view(self.gaussians(self.newest)), DEFAULT_FOV_RAD

    def changes(self, before: int, after: int) -> dict[str, tuple[Track, TrackEvent]]:
        """Return the object changes that separate two versions.

        Args:
            before: Number of the first version.
            after: Number of the second version.

        Returns:
            The changes with their objects, by description.
        """
        with open_history(self._folder) as store:
            sides = store.changes_between(before, after)
        return {
            f"{event.version}: {prefix}{describe_event(event, track.name)}": (track, event)
            for prefix, changes in zip(("", "undone: "), sides, strict=True)
            for track, event in changes
        }

    def update_image(self, number: int) -> RgbImage | None:
        """Return the image of an update: frames, and the map before and after.

        Args:
            number: Of the version.

        Returns:
            [H,W,3] uint8, at most `MAX_IMAGE_PX` wide; None if there is none, or none of a sane
            size.

        Raises:
            OSError: The file cannot be read.
            ValueError: The file is no image.
        """
        path = update_image_path(self._folder, number)
        if not path.is_file() or path.stat().st_size > MAX_IMAGE_BYTES:
            return None
        width, height = image_size(path)
        if max(width, height) > MAX_SIDE_PX:
            return None
        return shrink_image(read_rgb(path, (height, width)), (MAX_IMAGE_PX, MAX_SIDE_PX))

    def tracks(self, number: int) -> list[Track]:
        """Return the history of each object that changed up to a version.

        Args:
            number: Of the version.
        """
        with open_history(self._folder) as store:
            return store.tracks(number)

    def track_at(self, number: int, point: Floats) -> Track | None:
        """Find the object at a point among those that changed.

        Args:
            number: Of the version.
            point: (3,) in the world, m.

        Returns:
            The smallest object with the point in its box; None if there is none.
        """
        found = [
            (volume_m3(box), track)
            for track in self.tracks(number)
            if (box := track.events[-1].boxes[1]) is not None and contains(box, point)
        ]
        return min(found, key=lambda pair: pair[0])[1] if found else None

    def has_words(self, number: int) -> bool:
        """Return whether a version has semantic features.

        Args:
            number: Of the version.
        """
        return self.gaussians(number).feature_dims > 0

    def find(self, number: int, text: str) -> list[Instance]:
        """Find the objects that match a text.

        Args:
            number: Of the version.
            text: Such as "alarm clock".

        Returns:
            The objects, the best first.

        Raises:
            ImportError: A package of the semantics is missing.
            OSError: A file cannot be read.
            ValueError: The map has no semantic features, or the text is empty.
        """
        with self._query_lock:
            return self._semantics(number).queries.find(text)

    def name_at(self, number: int, point: Floats) -> tuple[str, Instance | None] | None:
        """Name the object at a point by the semantic features of the Gaussians there.

        Args:
            number: Of the version.
            point: (3,) in the world, m.

        Returns:
            The name and the object with the point in its box, None if queries do not find it
            there; or None if nothing has a name there.

        Raises:
            ImportError, OSError, ValueError: As for `find`.
        """
        with self._query_lock:
            semantics, gaussian_map = self._semantics(number), self.gaussians(number)
            offsets = gaussian_map.means - (point - gaussian_map.origin)
            rows = np.flatnonzero(np.linalg.norm(offsets, axis=1) < PICK_RADIUS_M)
            classes = classify_gaussians(
                gaussian_map, rows, semantics.codec, semantics.queries.source, semantics.names
            )
            votes = np.bincount(classes[classes >= 0], minlength=1)
            if not votes.any():
                return None
            name = semantics.names[int(votes.argmax())]
            for instance in semantics.queries.find(name):
                if contains((instance.low, instance.high), point):
                    return name, instance
            return name, None

    def plan(self, number: int) -> SemanticMap:
        """Return the floor plan of a version.

        Args:
            number: Of the version.

        Raises:
            ValueError: The map shows no floor.
        """
        return self._plan(number)

    def target_of(self, number: int, instance: Instance) -> Target:
        """Return an object as a target of paths.

        Args:
            number: Of the version.
            instance: From `find`.
        """
        return Target.of_instance(self.gaussians(number), instance)

    def target_in(self, number: int, box: Box) -> Target:
        """Return what a box holds as a target of paths.

        Args:
            number: Of the version.
            box: In the world, m.
        """
        return Target.in_box(self.gaussians(number), box)

    def path(self, number: int, start: Floats, targets: Sequence[Target]) -> PlannedPath:
        """Plan a path over the floor to the nearest of some objects.

        Args:
            number: Of the version.
            start: (2,) x and y in the world, m.
            targets: The objects.

        Returns:
            The path, or the reason why there is none.

        Raises:
            ValueError: The map shows no floor.
        """
        terrain = Terrain(self.plan(number), RobotBody())
        free = terrain.free_positions()
        near = np.any([target.distances_m(free) <= ARRIVAL_M for target in targets], axis=0)
        return terrain.plan_to_any(start, free[near])

    def _cached(self, function: Callable[[int], Value], size: int) -> Callable[[int], Value]:
        """Return a function of the number of a version that remembers its last results."""
        cached = lru_cache(size)(lambda number, _replaced: function(number))
        lock = threading.Lock()

        def locked(number: int) -> Value:
            with lock:  # Nothing is read twice, and what is slow delays no other function.
                return cached(number, self.replaced)

        return locked

    def _read(self, number: int) -> GaussianMap:
        with open_map(self._folder) as store:
            return store.read(number)

    def _make_blocks(self, number: int) -> dict[Cell, Block]:
        return make_blocks(self.gaussians(number), self._edge_m)

    def _open_semantics(self, number: int) -> Semantics:
        found = read_semantics(self._folder.with_name(f"{self._folder.name}@{number}"))
        if found is None:
            raise ValueError("this version has no words; gslts semantics adds them")
        cause, codec = found
        source = open_text_source(cause, self._clip)
        queries = SemanticQueries(self.gaussians(number), codec, source)
        return Semantics(codec, cause.names or NOUNS, queries)

    def _make_plan(self, number: int) -> SemanticMap:
        return make_semantic_map(self.gaussians(number), RobotBody())


def _contents(versions: Sequence[Version]) -> list[Version]:
    """Return versions without their files, which gc removes."""
    return [version.model_copy(update={"delta": None}) for version in versions]
