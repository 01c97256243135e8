"""Fit of new Gaussians to frames of new space, together with the old ones at the seam."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.core.camera import Camera, downscale, shift_origin
from gslts.core.farthest_points import farthest_points
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.surface_margin import surface_margin_m
from gslts.extension.constants import (
    MAX_LOOSE_SHARE,
    MAX_REPLAYS,
    MIN_FREE_PIXELS,
    MIN_FREE_SHARE,
    MIN_KNOWN_ALPHA,
    MIN_SEEN,
    REPLAY_SEARCH_DIVISOR,
)
from gslts.extension.new_space import FrameSpace
from gslts.io.images import to_rgb8
from gslts.mapping.config import MappingConfig
from gslts.mapping.density.control import join
from gslts.mapping.measure import count_measurements
from gslts.mapping.observation import Observation
from gslts.mapping.seeding.depth_seeds import seed_from_depth
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Bools, Floats


@dataclass(frozen=True, eq=False)
class Patch:
    """The part of a map that an extension fits: Gaussians in view of the new frames, and new ones.

    Attributes:
        gaussian_map: float32, without features: old Gaussians, then new ones.
        fixed: [N] old ones that stay as they are; the other old ones are those of the seam.
    """

    gaussian_map: GaussianMap
    fixed: Bools


def make_patch(
    gaussian_map: GaussianMap,
    frames: Sequence[Observation],
    spaces: Sequence[FrameSpace],
    config: MappingConfig,
    first_id: int,
) -> Patch:
    """Seed Gaussians in new space, and choose the old ones that are refined with them.

    These are the ones that the frames show mostly where they know more than the map, and those that
    they see through, such as fog before a surface that the map saw from afar.

    Args:
        gaussian_map: float32.
        frames: Training frames of the extension, at their poses in the map.
        spaces: What each frame shows.
        config: Settings of the mapping.
        first_id: Id of the first new Gaussian.

    Raises:
        NoSurfaceError: No new surface was measured by two frames.
    """
    seeds = _seed(gaussian_map, frames, spaces, config)
    plain = replace(gaussian_map, features=np.zeros((gaussian_map.size, 0), np.float32))
    total, near, in_poor = _weights(plain, frames, spaces, config.threads)
    free = (total > MIN_FREE_PIXELS) & (in_poor > MIN_FREE_SHARE * near)
    confirmed, passed = count_measurements(plain, map(_drop_changed_depth, frames, spaces))
    free |= (passed >= MIN_SEEN) & (passed > confirmed)
    seen = total > 0
    fixed = np.concatenate([~free[seen], np.zeros(seeds.size, np.bool_)])
    return Patch(join(plain.select(seen), seeds, first_id), fixed)


def _drop_changed_depth(frame: Observation, space: FrameSpace) -> RgbdFrame:
    """Return a frame without the depth of what changed."""
    rgbd = frame.rgbd()
    return replace(rgbd, depth=np.where(space.changed, np.float32(0), rgbd.depth))


def _weights(
    gaussian_map: GaussianMap,
    frames: Sequence[Observation],
    spaces: Sequence[FrameSpace],
    threads: int,
) -> tuple[Floats, Floats, Floats]:
    """Return [N] sums of the blending weights.

    Returns:
        The sum over all pixels of all frames; the same over the squared distance, m, as what a near
        frame shows tells more; and that in pixels where the map is poor.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    total, near, in_poor = np.zeros((3, gaussian_map.size))
    for frame, space in zip(frames, spaces, strict=True):
        camera = shift_origin(frame.camera(), gaussian_map.origin)
        rasterizer.forward(gaussian_map, frame.camera(), options)
        seen = rasterizer.lift(space.poor[..., None].astype(np.float32))
        offsets = gaussian_map.means[seen.rows] - camera.world_from_camera[:3, 3]
        squares = (offsets.astype(np.float64) ** 2).sum(axis=1)
        total[seen.rows] += seen.weights
        near[seen.rows] += seen.weights / squares
        in_poor[seen.rows] += seen.weighted_features[:, 0] / squares
    return total, near, in_poor


def _seed(
    gaussian_map: GaussianMap,
    frames: Sequence[Observation],
    spaces: Sequence[FrameSpace],
    config: MappingConfig,
) -> GaussianMap:
    """Return seeds on the new surfaces, in the frame of the map's origin."""
    new = (
        _only(frame.rgbd(), space.new, gaussian_map)
        for frame, space in zip(frames, spaces, strict=True)
    )
    return seed_from_depth(
        new,
        config.voxel_m,
        config.seed_contrast,
        sh_degree=gaussian_map.sh_degree,
    )


def _only(frame: RgbdFrame, wanted: Bools, gaussian_map: GaussianMap) -> RgbdFrame:
    """Return some pixels of a frame, in the frame of the map's origin."""
    camera = shift_origin(frame.camera, gaussian_map.origin)
    mask = wanted if frame.mask is None else wanted & frame.mask
    return replace(frame, camera=camera, mask=mask)


def without_changes(frame: Observation, space: FrameSpace) -> Observation:
    """Return a frame whose mask leaves out what changed since the map was made.

    It also says whether it shows enough of the map to determine its exposure.

    Args:
        frame: Of the extension.
        space: What it shows.
    """
    shows_known = float((space.new | space.changed).mean()) < MAX_LOOSE_SHARE
    return replace(frame.with_mask(~space.changed), shows_known=shows_known)


def replay_frames(
    gaussian_map: GaussianMap, cameras: Iterable[Camera], patch: Patch, threads: int = 0
) -> list[Observation]:
    """Render the map at training cameras that see the seam, so that their side stays as it was.

    Args:
        gaussian_map: float32, before the extension.
        cameras: Training cameras of the map.
        patch: Its free old Gaussians are the seam.
        threads: Number of threads; 0 means all.

    Returns:
        At most `MAX_REPLAYS` frames, from positions as different as possible.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    seam = np.isin(gaussian_map.ids, patch.gaussian_map.ids[~patch.fixed])
    old = patch.gaussian_map.select(np.isin(patch.gaussian_map.ids, gaussian_map.ids))
    seeing = []
    for camera in cameras:
        images = rasterizer.forward(gaussian_map, downscale(camera, REPLAY_SEARCH_DIVISOR), options)
        if seam[rasterizer.backward(dL_dalpha=np.zeros_like(images.alpha)).rows].any():
            seeing.append(camera)
    positions = np.array([camera.world_from_camera[:3, 3] for camera in seeing]).reshape(-1, 3)
    frames = []
    for row in farthest_points(positions, MAX_REPLAYS):
        images = rasterizer.forward(gaussian_map, seeing[row], options)
        # Where the patch lacks what this camera sees, the fit would make it anew.
        own = rasterizer.forward(old, seeing[row], options)
        known = (images.alpha >= MIN_KNOWN_ALPHA) & (own.alpha >= MIN_KNOWN_ALPHA)
        known &= np.abs(own.depth - images.depth) < surface_margin_m(
            images.depth.astype(np.float64)
        )
        depth = np.where(known, images.depth, 0).astype(np.float32)
        frame = Observation.of(RgbdFrame(to_rgb8(images.rgb), depth, seeing[row], mask=known))
        frames.append(replace(frame, shows_known=True))
    return frames


def merge_patch(
    gaussian_map: GaussianMap, patch: Patch, fitted: GaussianMap, first_id: int
) -> GaussianMap:
    """Return the map with the fitted Gaussians of a patch.

    Args:
        gaussian_map: Before the extension.
        patch: Before the fit.
        fitted: Its Gaussians after the fit: old ones in their order, then new ones with ids of
            `first_id` or higher. Some of the seam may be gone.
        first_id: Id of the first new Gaussian.

    Returns:
        The map. Gaussians outside the patch, and its fixed ones, are bit-identical; new ones have
        no features, and ids from `first_id` on.
    """
    is_new = fitted.ids >= first_id
    old, new = fitted.select(~is_new), fitted.select(is_new)
    gone = np.setdiff1d(patch.gaussian_map.ids[patch.gaussian_map.ids < first_id], old.ids)
    rows, kept = np.searchsorted(gaussian_map.ids, old.ids), ~np.isin(gaussian_map.ids, gone)
    arrays = {}
    for name in ("means", "quats", "log_scales", "logit_opacities", "sh"):
        array = getattr(gaussian_map, name).copy()
        array[rows] = getattr(old, name)
        arrays[name] = array
    features = np.zeros((new.size, gaussian_map.feature_dims), np.float32)
    merged = replace(gaussian_map, **arrays).select(kept)
    return join(merged, replace(new, features=features), first_id)
