"""Selection of the Gaussians of removed objects, by votes of the views and by space carving.

Source: GS-LTS, sec. III-D, voting function V, eq. (11), and G_target.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts._core import edit as _core
from gslts._core.map import GaussianViewFloat
from gslts.core.gaussian_map import GaussianMap
from gslts.types import Bools, Ints32
from gslts.update.config import EditConfig
from gslts.update.evidence import is_visible
from gslts.update.region import Region
from gslts.update.views import View

SWEEP_NEIGHBORS, MIN_REMOVED_SHARE = 8, 0.75
"""A Gaussian is removed as well if at least this share of its nearest Gaussians was removed: such
remains would float in the air."""
MIN_CARVING_VIEWS = 2
"""Minimum number of views that must see through a Gaussian to carve it, if there are so many. One
view may err at an edge."""


def select_removed(
    gaussian_map: GaussianMap,
    views: Sequence[View],
    regions: Sequence[Region],
    config: EditConfig,
) -> Bools:
    """Select the Gaussians of removed objects: G_target of GS-LTS, and what is left of it.

    Args:
        gaussian_map: float32.
        views: Of the changes.
        regions: Regions of the changes.
        config: Settings.

    Returns:
        [N] bool.
    """
    removed = np.zeros(gaussian_map.size, np.bool_)
    emptied = [region for region in regions if region.side == "before"]
    if emptied:
        removed |= _select_by_votes(gaussian_map, views, emptied, config)
    near = gaussians_in_regions(gaussian_map, regions, config.margin_m)
    if config.carve:
        on, through = count_visibility(gaussian_map, views)
        removed |= near & (through >= min(MIN_CARVING_VIEWS, len(views))) & (through > on)
    if config.sweep and removed.any():
        rows = np.flatnonzero(near & ~removed)
        neighbors, _ = _core.nearest_gaussians(
            float_view(gaussian_map), gaussian_map.means[rows], SWEEP_NEIGHBORS + 1
        )
        # The nearest Gaussian is the Gaussian itself.
        removed_share = removed[neighbors[:, 1:]].mean(axis=1)
        removed[rows[removed_share >= MIN_REMOVED_SHARE]] = True
    return removed


def _select_by_votes(
    gaussian_map: GaussianMap,
    views: Sequence[View],
    emptied: Sequence[Region],
    config: EditConfig,
) -> Bools:
    """Return [N] Gaussians with V(g) > rho K, eq. (11).

    GS-LTS counts all K views of a region. With `visible_votes`, K is the number of views in which
    the map does not occlude the Gaussian.
    """
    rendered = [view.rendered_depth for view in views] if config.visible_votes else None
    masks = [np.ascontiguousarray(view.before) for view in views]
    votes, visible = _core.count_votes(
        float_view(gaussian_map), [view.camera for view in views], masks, rendered, _core.VoteRule()
    )
    # A relocation also has views of its other region, which cannot vote.
    of_region = sum(any(is_visible(view.frame, region) for region in emptied) for view in views)
    count = visible if config.visible_votes else of_region
    outvoted: Bools = votes > config.vote_share * count
    return outvoted


def count_visibility(gaussian_map: GaussianMap, views: Sequence[View]) -> tuple[Ints32, Ints32]:
    """Count the views that measured a surface at each Gaussian, or behind it.

    Args:
        gaussian_map: float32.
        views: With measured depth.

    Returns:
        [N] int32 views with a surface at the centre, and [N] int32 views that see through it.
    """
    cameras, depths = [view.camera for view in views], [view.depth for view in views]
    return _core.count_visibility(float_view(gaussian_map), cameras, depths, _core.DepthTolerance())


def gaussians_in_regions(
    gaussian_map: GaussianMap, regions: Sequence[Region], margin_m: float
) -> Bools:
    """Return the Gaussians whose centres lie in a region.

    Args:
        gaussian_map: Any map.
        regions: Boxes in the world frame.
        margin_m: Enlarges the boxes on all sides, m.

    Returns:
        [N] bool.
    """
    inside = np.zeros(gaussian_map.size, np.bool_)
    for region in regions:
        rows = gaussian_map.rows_in_box(region.low - margin_m, region.high + margin_m)
        inside[rows] |= region.contains(gaussian_map.centers(rows), margin_m)
    return inside


def float_view(gaussian_map: GaussianMap) -> GaussianViewFloat:
    """Return the view of a map for the compiled module.

    Args:
        gaussian_map: float32.

    Returns:
        The view; it shares the memory of the map.

    Raises:
        ValueError: The map is not float32.
    """
    view = gaussian_map.view()
    if not isinstance(view, GaussianViewFloat):
        raise ValueError(f"pre_edit: gaussian_map: expected float32, got {gaussian_map.dtype}")
    return view
