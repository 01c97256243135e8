"""Changes made in a map: an object is taken out, copied or moved, and frames show the opposite."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Literal

import numpy as np

from gslts.change.changes import SIDES, Box, Change, Side
from gslts.core.camera import Camera, downscale
from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.density.control import join
from gslts.rendering.rasterizer import RenderOptions, render
from gslts.store.records import Updates
from gslts.types import Bools, Floats, Floats32, Ints
from gslts_bench.real.objects import StandingObject, find_objects, free_places
from gslts_bench.real.planes import surface_points

MadeKind = Literal["addition", "removal", "relocation"]
"""Kind of a change that is made in a map: shifts are none."""
SIDES_OF: dict[MadeKind, tuple[Side, ...]] = {
    "addition": ("after",),
    "removal": ("before",),
    "relocation": SIDES,
}
"""Sides of the changes that frames show: of an object that the map lacks, has twice, or has
elsewhere."""
PLACES = 6
"""Maximum number of places that are tried per object."""
WIDTH_PX = 160
"""Width of the images in which frames are chosen."""
MIN_SIZE_PX = 400
"""Minimum number of visible pixels of an object, of 640 x 480: 20 x 20."""
MIN_VISIBLE_SHARE = 0.7
"""Minimum share of an object that nothing hides."""
MIN_KNOWN_SHARE, MIN_ALPHA = 0.9, 0.8
"""Minimum share of the region of an object in which the changed map is known, and its alpha there:
where the map never saw what is behind the object, nothing can be compared."""
MIN_CONTRAST = 0.06
"""Minimum mean difference of the colours of an object and of what is behind it, 0 to 1: bumps of a
surface, which are errors of the map, hardly differ from it."""
MARGIN_PX = 2
"""Minimum distance of an object from the border of an image of `WIDTH_PX`, px."""
OPAQUE = 0.5
"""Minimum alpha of an object at its pixels."""
HIDDEN_M = 0.03
"""Minimum distance of what hides an object, m: above the errors of rendered depth."""
FULL_WIDTH_PX = 640
"""Image width in which pixels of objects are counted, whatever the size of the frames."""


@dataclass(frozen=True, eq=False)
class MapChange:
    """A change of an object of a map: the map has it "before", and a frame of the room "after".

    Attributes:
        object_name: Number of the object and of the free place, such as `03_1`.
        kind: What the frame shows; the map is changed the other way round.
        standing: The object at its place.
        step: (2,) step to a free place, cells of the plane.
        frame: Name of the frame.
    """

    object_name: str
    kind: MadeKind
    standing: StandingObject
    step: Ints
    frame: str

    @property
    def name(self) -> str:
        """Name of the change, unique in its map."""
        return f"{self.object_name}/{self.frame}"

    def changed_map(self, gaussian_map: GaussianMap) -> GaussianMap:
        """Return the changed map; the plane of the free place fills the gap below the object.

        Args:
            gaussian_map: The map.
        """
        moved = self._gaussians(gaussian_map, "before")
        if self.kind == "removal":
            return join(gaussian_map, moved)
        plane, cells = self.standing.plane, self.standing.cells
        means = gaussian_map.means + gaussian_map.origin
        kept = ~plane.rows_on(means, cells)
        kept[self.standing.rows] = False
        filling = gaussian_map.select(plane.rows_on(means, cells + self.step))
        filling = _shift(filling, -plane.shift(self.step))
        bare = join(gaussian_map.select(kept), filling, int(gaussian_map.ids.max()) + 1)
        return bare if self.kind == "addition" else join(bare, moved)

    def made(self, gaussian_map: GaussianMap) -> Updates:
        """Return what was changed in the map: an object left the position where frames show it.

        Args:
            gaussian_map: The unchanged map.
        """
        left, came = (
            self._box(gaussian_map, side) if side in SIDES_OF[self.kind] else None
            for side in ("after", "before")
        )
        return Updates.of_boxes([(left, came)])

    def _box(self, gaussian_map: GaussianMap, side: Side) -> Box:
        """Return the box of the object before or after the change."""
        means = self._gaussians(gaussian_map, side).means + gaussian_map.origin
        return means.min(axis=0), means.max(axis=0)

    def truth(self, gaussian_map: GaussianMap, camera: Camera) -> Change:
        """Return the change that the frame shows, with masks of the regions of the object.

        Args:
            gaussian_map: The unchanged map.
            camera: Camera of the frame.
        """
        masks = self._visible(gaussian_map, camera, _render(gaussian_map, camera)[1])
        before, after = (masks[side][0] if side in masks else None for side in SIDES)
        point = self._gaussians(gaussian_map, SIDES_OF[self.kind][0]).means.mean(axis=0)
        return Change(self.kind, 1.0, point.astype(np.float64), masks=(before, after))

    def is_in_view(
        self, gaussian_map: GaussianMap, camera: Camera, rgb: Floats32, depth: Floats32
    ) -> bool:
        """Return whether a camera sees the object at all sides, and what is behind it.

        Args:
            gaussian_map: The unchanged map.
            camera: Camera of the frame.
            rgb: [H,W,3] its rendered image.
            depth: [H,W] its rendered depth, m.
        """
        scale = (FULL_WIDTH_PX / camera.width) ** 2
        region = np.zeros(depth.shape, np.bool_)
        for visible, share in self._visible(gaussian_map, camera, depth).values():
            inner = visible[MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX].sum()
            if share < MIN_VISIBLE_SHARE or scale * inner < MIN_SIZE_PX or inner < visible.sum():
                return False
            region |= visible
        images = render(self.changed_map(gaussian_map), camera, RenderOptions(threads=1))
        contrast = np.abs(images.rgb - rgb)[region].mean()
        known_share = (images.alpha[region] >= MIN_ALPHA).mean()
        return bool(known_share >= MIN_KNOWN_SHARE and contrast >= MIN_CONTRAST)

    def _visible(
        self, gaussian_map: GaussianMap, camera: Camera, depth: Floats32
    ) -> dict[Side, tuple[Bools, float]]:
        """Return the visible pixels [H,W] of the object and their share, by side."""
        found: dict[Side, tuple[Bools, float]] = {}
        for side in SIDES_OF[self.kind]:
            images = render(self._gaussians(gaussian_map, side), camera, RenderOptions(threads=1))
            own = images.alpha > OPAQUE
            visible = own & (images.depth < depth + HIDDEN_M)
            found[side] = visible, float(visible.sum() / max(1, own.sum()))
        return found

    def _gaussians(self, gaussian_map: GaussianMap, side: Side) -> GaussianMap:
        """Return the object where the changed map has it before, or the frame after."""
        gaussians = gaussian_map.select(self.standing.rows)
        if side == "after":
            return gaussians
        return _shift(gaussians, self.standing.plane.shift(self.step))


def make_changes(
    gaussian_map: GaussianMap,
    training: Sequence[Camera],
    frames: Mapping[str, Camera],
    count: int,
    seed: int,
) -> list[MapChange]:
    """Choose objects, free places and frames that see them, of as many objects as there are.

    Args:
        gaussian_map: The map.
        training: Training cameras of the map.
        frames: Cameras of the frames to choose from, by name.
        count: Maximum number of changes of each kind.
        seed: Decides the choice.

    Returns:
        The changes, by kind; fewer where the map does not give so many.
    """
    rng = np.random.default_rng(seed)
    surface = surface_points(gaussian_map, training)
    small = {name: downscale(c, max(1, c.width // WIDTH_PX)) for name, c in frames.items()}
    images = {name: _render(gaussian_map, camera) for name, camera in small.items()}
    chosen: dict[MadeKind, list[list[MapChange]]] = {kind: [] for kind in SIDES_OF}
    for number, standing in enumerate(find_objects(gaussian_map, surface, seed)):
        places = list(islice(free_places(standing, surface.points, rng), PLACES))
        for kind, of_objects in chosen.items():
            candidates = [
                MapChange(f"{number:02}_{place}", kind, standing, step, name)
                for name in frames
                for place, step in enumerate(places if kind != "addition" else places[:1])
            ]
            order = rng.permutation(len(candidates))
            seen = (
                candidates[k]
                for k in order
                if candidates[k].is_in_view(
                    gaussian_map, small[candidates[k].frame], *images[candidates[k].frame]
                )
            )
            of_objects.append(list(islice(seen, count)))
    return [change for lists in chosen.values() for change in islice(_alternating(lists), count)]


def _alternating(of_objects: Sequence[Sequence[MapChange]]) -> Iterator[MapChange]:
    """Yield the first change of each object, the second of each, and so on."""
    for k in range(max(map(len, of_objects), default=0)):
        yield from (changes[k] for changes in of_objects if k < len(changes))


def _render(gaussian_map: GaussianMap, camera: Camera) -> tuple[Floats32, Floats32]:
    """Render colours [H,W,3] and depth [H,W], m."""
    images = render(gaussian_map, camera, RenderOptions(threads=1))
    return images.rgb.astype(np.float32), images.depth.astype(np.float32)


def _shift(gaussians: GaussianMap, shift: Floats) -> GaussianMap:
    return replace(gaussians, means=(gaussians.means + shift).astype(gaussians.dtype))
