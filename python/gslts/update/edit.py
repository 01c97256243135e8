"""Pre-editing of a map: removes and adds Gaussians before the refinement.

Source: GS-LTS, sec. III-D, Gaussian Editing based Scene Update. `GS_LTS` selects the printed
method; each setting of `EditConfig` corrects one of its weaknesses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts._core import edit as _core
from gslts._core.fusion import SurfaceVoxels
from gslts.core.camera import shift_origin
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.io.images import to_rgb8
from gslts.mapping.density.control import join
from gslts.mapping.seeding.depth_seeds import MIN_HITS, seed_from_depth
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.rendering.view_range import view_range_m
from gslts.types import Bools
from gslts.update.config import EditConfig
from gslts.update.evidence import is_visible
from gslts.update.region import Region
from gslts.update.selection import float_view, gaussians_in_regions, select_removed
from gslts.update.views import View, pixels_in_region

PIXEL_STEP = 1
"""Every pixel of a view seeds points: handles and legs are few pixels wide."""
FUSION_VOXEL_M = 0.01
"""Edge of the voxels that fuse points with inherited attributes, m."""
MAX_BEHIND_M, MAX_BEHIND_SHARE = 0.03, 0.015
"""A measured surface needs new Gaussians if the map's surface lies farther behind it than this, m
plus a share of the depth."""
MIN_ALPHA = 0.6
"""A measured surface needs new Gaussians if the map is less opaque than this."""


@dataclass(frozen=True, eq=False)
class Edit:
    """Result of the pre-editing.

    Attributes:
        gaussian_map: Edited map; new Gaussians come last.
        removed: [N] bool, Gaussians of the map before the edit.
        added: Number of new Gaussians.
    """

    gaussian_map: GaussianMap
    removed: Bools
    added: int


def pre_edit(
    gaussian_map: GaussianMap,
    views: Sequence[View],
    regions_by_change: Sequence[Sequence[Region]],
    config: EditConfig,
    *,
    moved: Sequence[bool] = (),
    first_id: int | None = None,
    threads: int = 0,
) -> Edit:
    """Remove the Gaussians of removed objects, and add those of added objects and of filled holes.

    A relocated object keeps its semantic features, drawn at random from its removed Gaussians as in
    GS-LTS. Features of an added object are zero until frames give them (`MapSemantics`).

    Args:
        gaussian_map: float32, at least one Gaussian.
        views: Of the changes, at least one.
        regions_by_change: "before" and "after" regions of each change.
        config: Settings.
        moved: True for each change whose Gaussians are at their new positions already: new ones
            are parts of what is there, and get its features. None are, if it is empty.
        first_id: Id of the first new Gaussian; None means the next one after those of the map.
        threads: 0 uses all hardware threads.

    Returns:
        The edited map.

    Raises:
        ValueError: There is no view, or all Gaussians would be removed.
    """
    if not views:
        raise ValueError("pre_edit: views: expected at least one, got none")
    regions = [region for own in regions_by_change for region in own]
    removed = select_removed(gaussian_map, views, regions, config)
    if removed.all():
        raise ValueError("pre_edit: gaussian_map: all Gaussians would be removed")
    kept, gone = gaussian_map.select(~removed), gaussian_map.select(removed)
    masks = _uncovered_pixels(kept, views, regions, config, threads)
    frames = _measured_frames(kept, views, masks)
    if config.flat:
        new = _flat_gaussians(kept, frames, config, _common_views(views, regions_by_change))
    else:
        new = _with_attributes_of_nearest(kept, frames)
    if new.size == 0:
        return Edit(kept, removed, 0)
    drawn = [
        own for row, own in enumerate(regions_by_change) if not (row < len(moved) and moved[row])
    ]
    new = _with_appearance(new, kept, gone, drawn, config)
    if first_id is None:
        first_id = gaussian_map.next_id  # Also after the removed ones.
    return Edit(join(kept, new, first_id), removed, new.size)


def _uncovered_pixels(
    kept: GaussianMap,
    views: Sequence[View],
    regions: Sequence[Region],
    config: EditConfig,
    threads: int,
) -> list[Bools]:
    """Return [H,W] of each view, the measured surfaces that the map does not show."""
    if not config.only_missing:
        return [view.changed for view in views]
    rasterizer, plain = Rasterizer(np.float32), kept.without_features()
    masks = []
    for view in views:
        near = view.changed.copy()
        for region in regions:
            near |= pixels_in_region(view.depth, view.camera, region, config.margin_m)
        options = RenderOptions(far_m=view_range_m(view.depth), threads=threads)
        images = rasterizer.forward(plain, view.camera, options, mask=near)
        behind_m = images.depth - view.depth
        max_behind_m = MAX_BEHIND_M + MAX_BEHIND_SHARE * view.depth
        covered = (images.alpha >= MIN_ALPHA) & (behind_m < max_behind_m)
        # Depth cannot separate a flat object from the surface below it.
        masks.append((near & ~covered) | view.after)
    return masks


def _measured_frames(
    kept: GaussianMap, views: Sequence[View], masks: Sequence[Bools]
) -> list[RgbdFrame]:
    """Return masked frames with the exposure of the map, in the frame of its Gaussians."""
    frames = []
    for view, mask in zip(views, masks, strict=True):
        colors = to_rgb8(view.colors)
        camera = shift_origin(view.camera, kept.origin)
        allowed = mask if view.frame.mask is None else mask & view.frame.mask
        frames.append(RgbdFrame(colors, view.depth, camera, mask=allowed))
    return frames


def _common_views(views: Sequence[View], regions_by_change: Sequence[Sequence[Region]]) -> int:
    """Return the number of views that show each change, at least 1."""
    counts = [
        sum(any(is_visible(view.frame, region) for region in regions) for view in views)
        for regions in regions_by_change
    ]
    return max(1, min(counts, default=1))


def _flat_gaussians(
    kept: GaussianMap, frames: Sequence[RgbdFrame], config: EditConfig, common_views: int
) -> GaussianMap:
    """Return flat Gaussians on the measured surfaces, with the observed colours."""
    try:
        new = seed_from_depth(
            frames,
            config.voxel_m,
            config.contrast,
            sh_degree=kept.sh_degree,
            min_hits=min(MIN_HITS, common_views),
            pixel_step=PIXEL_STEP,
        )
    except ValueError:  # Nothing was measured there.
        return kept.select(np.zeros(0, np.int64))
    return replace(new, origin=kept.origin)


def _with_attributes_of_nearest(kept: GaussianMap, frames: Sequence[RgbdFrame]) -> GaussianMap:
    """Return Gaussians at measured points with the attributes of their nearest neighbours g_nn.

    Source: GS-LTS, eq. (12) and (13).

    They are as dense as their surroundings.
    """
    voxels = SurfaceVoxels(FUSION_VOXEL_M, PIXEL_STEP)
    for frame in frames:
        assert frame.mask is not None
        voxels.add(frame.depth, frame.rgb, frame.camera, np.ascontiguousarray(frame.mask))
    _, sums, _ = voxels.voxels()
    points = (sums[:, 1:4] / sums[:, :1]).astype(np.float32)
    nearest, _ = _core.nearest_gaussians(float_view(kept), points, 1)
    _, distances_m = _core.nearest_gaussians(float_view(kept), kept.means[nearest[:, 0]], 2)
    spacing_m = np.maximum(distances_m[:, -1], np.float32(FUSION_VOXEL_M))
    rows = _core.thin_points(points, spacing_m)
    return GaussianMap(
        **_core.inherit_attributes(float_view(kept), points[rows], nearest[rows, 0], 0)
    )


def _with_appearance(
    new: GaussianMap,
    kept: GaussianMap,
    gone: GaussianMap,
    regions_by_change: Sequence[Sequence[Region]],
    config: EditConfig,
) -> GaussianMap:
    """Return new Gaussians with semantic features, and with inherited colours if configured.

    Gaussians of a filled hole inherit from the nearest ones; those of a relocated object are drawn
    from its colours C and semantics S, GS-LTS, eq. (14).
    """
    if config.observed_colors and kept.feature_dims == 0:
        return replace(new, features=np.zeros((new.size, 0), np.float32))
    nearest, _ = _core.nearest_gaussians(float_view(kept), new.means, 1)
    sh, features = kept.sh[nearest[:, 0]], kept.features[nearest[:, 0]]
    rng = np.random.default_rng(0)
    for regions in regions_by_change:
        before = [region for region in regions if region.side == "before"]
        after = [region for region in regions if region.side == "after"]
        rows = np.flatnonzero(gaussians_in_regions(new, after, config.margin_m))
        features[rows] = 0
        sources = np.flatnonzero(gaussians_in_regions(gone, before, config.margin_m))
        if len(sources):
            drawn = rng.choice(sources, len(rows))
            sh[rows], features[rows] = gone.sh[drawn], gone.features[drawn]
    return replace(new, sh=new.sh if config.observed_colors else sh, features=features)
