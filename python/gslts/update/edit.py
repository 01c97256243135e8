"""Pre-editing: which Gaussians go and which come, before any is refined.

Source: GS-LTS, sec. III-D, Gaussian Editing based Scene Update. `GS_LTS` is that as printed; each
setting of `EditConfig` mends one of its weaknesses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gslts._core import edit as _core
from gslts._core.fusion import SurfaceVoxels
from gslts._core.map import GaussianViewFloat
from gslts.core.camera import shift_origin
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.density.control import joined
from gslts.mapping.seeding.depth_seeds import seed_from_depth
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Bools
from gslts.update.config import EditConfig
from gslts.update.evidence import shows
from gslts.update.region import Region
from gslts.update.views import View, near_region

PIXEL_STEP = 1
"""Every pixel is looked at: handles and legs are few pixels wide."""
FUSED_M = 0.01
"""Points that inherit are fused in voxels of such an edge."""
SWEEP_NEIGHBOURS, SWEEP_SHARE = 8, 0.75
"""What is left is swept away where such a share of so many nearest Gaussians was removed."""
LEAST_THROUGH = 2
"""Views that must see through a Gaussian, if there are so many: one may err at an edge."""
SHOWN_M, SHOWN_SHARE = 0.03, 0.015
"""A measured surface needs Gaussians where that of the map is farther by more, m and share of the
depth. Where it is nearer, it would hide them."""
SHOWN_ALPHA = 0.6
"""And where the map is less opaque."""


@dataclass(frozen=True, eq=False)
class Edit:
    """An edited map.

    Attributes:
        gaussian_map: New Gaussians come last.
        removed: [N] bool, of the map before.
        added: How many are new.
    """

    gaussian_map: GaussianMap
    removed: Bools
    added: int


def pre_edit(
    gaussian_map: GaussianMap,
    views: Sequence[View],
    regions: Sequence[Sequence[Region]],
    config: EditConfig,
    *,
    first_id: int | None = None,
    threads: int = 0,
) -> Edit:
    """Removes what is gone and adds what is new.

    Objects that moved keep the semantic features that they had, drawn at random from what was
    removed, as in the paper; those of objects that were added are zeros until frames tell them
    (`gslts.semantics.map_semantics`).

    Args:
        gaussian_map: float32, at least one Gaussian.
        views: Of the changes, at least one.
        regions: Of each change, where something is gone ("before") and is new ("after").
        config: Settings.
        first_id: Of what is new; None means the next one after those of the map.
        threads: 0 means one a hardware thread.

    Raises:
        ValueError: There is no view, or nothing would be left.
    """
    if not views:
        raise ValueError("pre_edit: views: there is none")
    every = [region for own in regions for region in own]
    removed = removed_by(gaussian_map, views, every, config)
    if removed.all():
        raise ValueError("pre_edit: gaussian_map: all of it would be removed")
    kept = gaussian_map.select(~removed)
    gone = gaussian_map.select(removed)
    wanted = _wanted(kept, views, every, config, threads)
    frames = _frames(kept, views, wanted)
    new = _flat_ones(kept, frames, config) if config.flat else _like_nearest(kept, frames)
    if new.size == 0:
        return Edit(kept, removed, 0)
    new = _painted(new, kept, gone, regions, config)
    if first_id is None:
        first_id = int(gaussian_map.ids.max()) + 1  # Not one of those that were removed.
    return Edit(joined(kept, new, first_id), removed, new.size)


def removed_by(
    gaussian_map: GaussianMap,
    views: Sequence[View],
    regions: Sequence[Region],
    config: EditConfig,
) -> Bools:
    """[N] the Gaussians of what is gone: G_target of the paper, and what is left of it.

    Args:
        gaussian_map: float32.
        views: Of the changes.
        regions: Where something changed.
        config: Settings.
    """
    cameras = [view.camera for view in views]
    removed = np.zeros(gaussian_map.size, np.bool_)
    emptied = [region for region in regions if region.side == "before"]
    if emptied:
        rendered = [view.rendered for view in views] if config.visible_votes else None
        masks = [np.ascontiguousarray(view.before) for view in views]
        votes, seen = _core.count_votes(
            _view(gaussian_map), cameras, masks, rendered, _core.VoteRule()
        )
        # K of the paper is that of one region; a relocation has views of another one, too.
        of_region = sum(any(shows(view.frame, region) for region in emptied) for view in views)
        of = seen if config.visible_votes else of_region
        removed |= votes > config.vote_share * of
    near = near_regions(gaussian_map, regions, config.margin_m)
    if config.carve:
        on, through = sightings(gaussian_map, views)
        removed |= near & (through >= min(LEAST_THROUGH, len(views))) & (through > on)
    if config.sweep and removed.any():
        rows = np.flatnonzero(near & ~removed)
        around, _ = _core.nearest_gaussians(
            _view(gaussian_map), gaussian_map.means[rows], SWEEP_NEIGHBOURS + 1
        )
        gone = removed[around[:, 1:]].mean(axis=1)  # The nearest is the Gaussian itself.
        removed[rows[gone >= SWEEP_SHARE]] = True
    return removed


def sightings(
    gaussian_map: GaussianMap, views: Sequence[View]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """[N] how many views measured a surface at each centre, and how many one behind it.

    Args:
        gaussian_map: float32.
        views: Whose depth counts.
    """
    cameras, depths = [view.camera for view in views], [view.depth for view in views]
    return _core.count_visibility(_view(gaussian_map), cameras, depths, _core.DepthTolerance())


def near_regions(gaussian_map: GaussianMap, regions: Sequence[Region], margin_m: float) -> Bools:
    """[N] which centres are in the boxes of regions, or near them.

    Args:
        gaussian_map: Of any dtype.
        regions: In the world.
        margin_m: How near to a box.
    """
    centres = gaussian_map.means + gaussian_map.origin
    near = [region.contains(centres, margin_m) for region in regions]
    return np.any(near, axis=0) if near else np.zeros(gaussian_map.size, np.bool_)


def _wanted(
    kept: GaussianMap,
    views: Sequence[View],
    regions: Sequence[Region],
    config: EditConfig,
    threads: int,
) -> list[Bools]:
    """[H,W] of each view, where a surface was measured that needs Gaussians."""
    if not config.only_missing:
        return [view.changed for view in views]
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    wanted = []
    for view in views:
        near = np.zeros(view.changed.shape, np.bool_)
        for region in regions:
            near |= near_region(view.depth, view.camera, region, config.margin_m)
        images = rasterizer.forward(kept, view.camera, options, mask=near | view.changed)
        farther_m = images.depth - view.depth
        shown = (images.alpha >= SHOWN_ALPHA) & (farther_m < SHOWN_M + SHOWN_SHARE * view.depth)
        # What lies flat on something is shown by what it lies on, as far as depth can tell.
        wanted.append(((near | view.changed) & ~shown) | view.after)
    return wanted


def _frames(kept: GaussianMap, views: Sequence[View], wanted: Sequence[Bools]) -> list[RgbdFrame]:
    """What was measured, in the colours and in the frame of the map."""
    frames = []
    for view, mask in zip(views, wanted, strict=True):
        colors = np.rint(255 * view.colors.clip(0, 1)).astype(np.uint8)
        camera = shift_origin(view.camera, kept.origin)
        allowed = mask if view.frame.mask is None else mask & view.frame.mask
        frames.append(RgbdFrame(colors, view.depth, camera, mask=allowed))
    return frames


def _flat_ones(kept: GaussianMap, frames: Sequence[RgbdFrame], config: EditConfig) -> GaussianMap:
    """Flat Gaussians on measured surfaces, with the colours of the photographs."""
    try:
        new = seed_from_depth(
            frames,
            config.voxel_m,
            config.contrast,
            sh_degree=kept.sh_degree,
            least_hits=min(2, len(frames)),
            pixel_step=PIXEL_STEP,
        )
    except ValueError:  # Nothing was measured there.
        return kept.select(np.zeros(0, np.int64))
    return replace(new, origin=kept.origin)  # The frames are in the frame of the map.


def _like_nearest(kept: GaussianMap, frames: Sequence[RgbdFrame]) -> GaussianMap:
    """Gaussians at measured points, as dense as their surroundings and like the nearest ones."""
    voxels = SurfaceVoxels(FUSED_M, PIXEL_STEP)
    for frame in frames:
        assert frame.mask is not None  # It says what is wanted.
        voxels.add(frame.depth, frame.rgb, frame.camera, np.ascontiguousarray(frame.mask))
    _, sums, _ = voxels.voxels()
    points = (sums[:, 1:4] / sums[:, :1]).astype(np.float32)
    nearest, _ = _core.nearest_gaussians(_view(kept), points, 1)
    _, apart_m = _core.nearest_gaussians(_view(kept), kept.means[nearest[:, 0]], 2)
    stay = _core.thin_points(points, np.maximum(apart_m[:, -1], np.float32(FUSED_M)))
    arrays = _core.inherit_attributes(_view(kept), points[stay], nearest[stay, 0], 0)
    return GaussianMap(**arrays)


def _painted(
    new: GaussianMap,
    kept: GaussianMap,
    gone: GaussianMap,
    regions: Sequence[Sequence[Region]],
    config: EditConfig,
) -> GaussianMap:
    """New Gaussians with features, and with colours if these are not those that were observed.

    What fills a hole is like the nearest Gaussians; an object that moved is as it was.
    """
    if config.observed_colors and kept.feature_dims == 0:
        return replace(new, features=np.zeros((new.size, 0), np.float32))
    nearest, _ = _core.nearest_gaussians(_view(kept), new.means, 1)
    sh, features = kept.sh[nearest[:, 0]], kept.features[nearest[:, 0]]
    rng = np.random.default_rng(0)
    for own in regions:
        before, after = (
            [region for region in own if region.side == side] for side in ("before", "after")
        )
        rows = np.flatnonzero(near_regions(new, after, config.margin_m))
        features[rows] = 0
        was = np.flatnonzero(near_regions(gone, before, config.margin_m))
        if len(was):  # The object moved.
            drawn = rng.choice(was, len(rows))
            sh[rows], features[rows] = gone.sh[drawn], gone.features[drawn]
    return replace(new, sh=new.sh if config.observed_colors else sh, features=features)


def _view(gaussian_map: GaussianMap) -> GaussianViewFloat:
    view = gaussian_map.view()
    if not isinstance(view, GaussianViewFloat):
        raise ValueError(f"pre_edit: gaussian_map: expected float32, got {gaussian_map.dtype}")
    return view
