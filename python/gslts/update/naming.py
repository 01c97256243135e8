"""Semantic features of what an update added, and names that tell two objects apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.map_semantics import MapSemantics
from gslts.update.config import UpdateConfig
from gslts.update.selection import gaussians_in_regions
from gslts.update.view_collection import Collection

SEMANTICS_MARGIN_M = 0.02
"""Margin around a region in which semantic features are recomputed: the table below a removed
object becomes visible, m."""


def name_changes(
    before: GaussianMap,
    updated: GaussianMap,
    collection: Collection,
    semantics: MapSemantics,
    config: UpdateConfig,
) -> tuple[GaussianMap, Collection]:
    """Return the map with semantic features of what is new.

    A relocated object keeps its features, and so does a shifted one with all that stands on it. If
    the frames call what came by another name than the map calls what is gone, these are two
    objects, and two changes.

    Args:
        before: Map before the update.
        updated: Map after it.
        collection: Changes that the map shows now, and their views.
        semantics: Of the map.
        config: Settings of the update.

    Returns:
        The map with the features, and the collection with such relocations separated.
    """
    frames = [(view.frame, view.changed) for view in collection.views]
    new, removed = ~np.isin(updated.ids, before.ids), ~np.isin(before.ids, updated.ids)
    by_change = list(zip(collection.changes, collection.regions_by_change, strict=True))
    replaced = [region for change, own in by_change for region in own if change.kind != "shift"]
    stale = new | gaussians_in_regions(updated, replaced, SEMANTICS_MARGIN_M)
    observed = semantics.update_features(updated, stale, frames, config.threads)
    features, apart = observed.features.copy(), []
    for change, regions in by_change:
        if change.kind != "relocation":
            apart.append(False)
            continue
        (old,), (destination,) = (
            [region for region in regions if region.side == side] for side in ("before", "after")
        )
        gone = np.flatnonzero(removed & gaussians_in_regions(before, [old], 0.0))
        came = np.flatnonzero(new & gaussians_in_regions(updated, [destination], 0.0))
        names = {semantics.name_of(before, gone), semantics.name_of(observed, came)}
        apart.append(len(names - {None}) == 2)
        if not apart[-1]:
            near = gaussians_in_regions(updated, [destination], config.edit.margin_m)
            kept = near & updated.features.any(axis=1)
            features[kept] = updated.features[kept]
    return replace(observed, features=features), collection.separate(apart)
