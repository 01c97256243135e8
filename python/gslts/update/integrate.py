"""Active Scene Updater: integrates object changes into a map in memory.

The stages are those of GS-LTS, sec. III-D: collect views, pre-edit, refine; we add a verification
by held-out views. `gslts.update.pipeline` runs them on a map on disk.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from gslts.change.changes import Change
from gslts.change.detector import ChangeDetector
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot
from gslts.mapping.clock import Clock
from gslts.rendering.metrics import psnr_from_mse_db
from gslts.semantics.map_semantics import MapSemantics
from gslts.store.causes import UpdateRecord
from gslts.store.delta import Delta, apply_deltas, compare_by_ids
from gslts.types import Bools, Indices
from gslts.update.config import UpdateConfig
from gslts.update.edit import Edit, pre_edit
from gslts.update.naming import name_changes
from gslts.update.part import rows_of_update
from gslts.update.refine import OnStep
from gslts.update.region import Region
from gslts.update.selection import gaussians_in_regions
from gslts.update.settle import active_gaussians, is_shown_by_few, refine_edit
from gslts.update.steadiness import unsteady_share
from gslts.update.verify import error_in_regions, split_views
from gslts.update.view_collection import Collection, collect_views
from gslts.update.views import View

Stage = Literal["collecting", "refining"]
Progress = Callable[[Stage], None]
"""Called after each step of a stage that takes long."""

MAX_UNSTEADY_SHARE = 0.3
"""Maximum share of the edited Gaussians that may move during the collection: somebody uses the
object."""
MAX_ERROR_SHARE = 0.98
"""Maximum error of validation views after an update, as a share of that before. Refinement
lowered it by 0.3 % in a home that the map does not show; true changes lower it by 10 % and more."""

MIN_EMPTIED, MIN_EMPTIED_SHARE = 20, 0.25
"""Number of Gaussians that an update removes with an object, or else minimum share of those in its
region, which may show the wall behind it as well. Of 132 removals in simulated homes and the
bookstore, 0.37 and more where few Gaussians had been an object, and at most 0.12 where the views
had shown an error of the map."""


@dataclass(frozen=True, eq=False)
class UpdateResult:
    """Result of an update of a map.

    Attributes:
        before: Map before the update.
        part: Gaussians of the updated map that the update may have read or changed.
        delta: Changes from the map before; none if the update was rejected.
        changes: Changes that the map shows now; empty if the update was rejected.
        rejected_changes: Changes that the map does not show, with the reasons.
        record: Timings, counts, and the reason if the update was rejected.
        views: Collected views, training views first.
        regions: Regions of the changes.
        moved: [N] bool for each of `changes`: Gaussians of the map before the update that a shift
            moved.
    """

    before: GaussianMap
    part: GaussianMap
    delta: Delta
    changes: tuple[Change, ...]
    rejected_changes: tuple[tuple[Change, str], ...]
    record: UpdateRecord
    views: tuple[View, ...]
    regions: tuple[Region, ...]
    moved: tuple[Bools, ...] = ()

    @cached_property
    def gaussian_map(self) -> GaussianMap:
        """Updated map, or the given one if the update was rejected; a copy made at first use."""
        return apply_deltas(self.before, [self.delta]) if self.delta.touched else self.before

    @property
    def rejected(self) -> str | None:
        """Reason for leaving the map unchanged; None if the update was accepted."""
        return self.record.rejected


def integrate_changes(
    gaussian_map: GaussianMap,
    cameras: Sequence[Camera],
    changes: Sequence[Change],
    robot: Robot,
    config: UpdateConfig | None = None,
    *,
    detector: ChangeDetector | None = None,
    recorded: Sequence[RgbdFrame] = (),
    first_id: int | None = None,
    semantics: MapSemantics | None = None,
    progress: Progress = lambda _: None,
) -> UpdateResult:
    """Collect views of some changes with a robot, and update the map by them.

    Only Gaussians near the changes are modified. A change is rejected if too few views show its
    regions, or do not confirm it, or if validation views do not fit better than before. The update
    is rejected if no change is left, or if an object moves during the collection.

    Args:
        gaussian_map: float32.
        cameras: Training cameras of the map.
        changes: As detected.
        robot: Near the changes.
        config: Settings; None means the defaults.
        detector: Of the map; None means one with default settings.
        recorded: Frames taken before; those that show a change are views as well.
        first_id: Id of the first new Gaussian; None means the next one after those of the map.
        semantics: Of the map; new Gaussians get semantic features from the frames.
        progress: Called after each step of the stages that take long.

    Returns:
        The updated map, or the reason for the rejection.

    Raises:
        ValueError: The map is not float32, or all Gaussians would be removed.
    """
    config = UpdateConfig() if config is None else config
    detector = detector or ChangeDetector(gaussian_map, cameras=cameras)
    clock = Clock(None, {})
    collection = collect_views(
        robot,
        detector,
        changes,
        config.collect,
        recorded=recorded,
        rigid=config.edit.rigid,
        threads=config.threads,
        progress=lambda: progress("collecting"),
    )
    clock.note("collecting")
    rows = rows_of_update(gaussian_map, cameras, collection.views, collection.regions, config)
    before = gaussian_map.select(rows)
    updated, collection, record = integrate_views(
        before,
        cameras,
        collection.of_part(rows),
        config,
        detector=detector,
        first_id=gaussian_map.next_id if first_id is None else first_id,
        on_step=lambda *_: progress("refining"),
    )
    record = record.model_copy(update={"seconds": {**clock.stages, **record.seconds}})
    training, validation = split_views(
        collection.views, collection.regions_by_change, config.collect.validation_every
    )
    if record.rejected is None and semantics is not None:
        updated, collection = name_changes(before, updated, collection, semantics, config)
        kinds = tuple(change.kind for change in collection.changes)
        record = record.model_copy(update={"kinds": kinds})
    confirmed, rejected = collection.changes, collection.rejected
    if record.rejected is not None:
        rejected += tuple((change, record.rejected) for change in confirmed)
        confirmed = ()
    views = (*training, *validation)
    moved: tuple[Bools, ...] = ()
    if confirmed:
        moved = tuple(_spread(part, rows, gaussian_map.size) for part in collection.moved)
    else:
        updated = before
    return UpdateResult(
        before=gaussian_map,
        part=updated,
        delta=compare_by_ids(before, updated),
        changes=confirmed,
        rejected_changes=rejected,
        record=record,
        views=views,
        regions=collection.regions,
        moved=moved,
    )


def _spread(part: Bools, rows: Indices, size: int) -> Bools:
    """Return [N] marks of a whole map from marks [M] of its rows."""
    marks = np.zeros(size, np.bool_)
    marks[rows] = part
    return marks


def integrate_views(
    gaussian_map: GaussianMap,
    cameras: Sequence[Camera],
    collection: Collection,
    config: UpdateConfig,
    *,
    detector: ChangeDetector | None = None,
    first_id: int | None = None,
    on_step: OnStep = lambda *_: None,
) -> tuple[GaussianMap, Collection, UpdateRecord]:
    """Update a map by collected views: pre-edit, refine and verify.

    A change after which validation views do not fit better is left out, and the map is updated by
    the others anew. Where few views show a change, the verified update is made once more by all of
    them: a validation view is up to half of what is known of the object.

    Args:
        gaussian_map: float32.
        cameras: Training cameras of the map.
        collection: Views of the changes.
        config: Settings.
        detector: Of the map; the refinement is repeated while the detector still sees a change in
            the training views. None means one refinement.
        first_id: Id of the first new Gaussian; None means the next one after those of the map.
        on_step: Called after each step of the refinement.

    Returns:
        The updated map, or the given one if the update was rejected; the collection with the
        changes that the map shows now; and the record.

    Raises:
        ValueError: All Gaussians would be removed.
    """
    clock = Clock(None, {})
    while True:
        updated, reasons, record = _integrate_once(
            gaussian_map, cameras, collection, config, detector, first_id, on_step, clock
        )
        if record.rejected is not None:
            return gaussian_map, collection, record
        if not any(reasons):
            break
        collection = collection.reject(reasons, gaussian_map, config.threads)
    views = collection.views
    if not any(is_shown_by_few(region, views) for region in collection.regions):
        return updated, collection, record
    edit = _pre_edit(gaussian_map, collection, views, config, first_id)
    updated, counts = _refine(
        gaussian_map, edit, cameras, collection, views, config, detector, on_step
    )
    clock.note("refining")
    return updated, collection, record.model_copy(update={**counts, "seconds": clock.stages})


def _integrate_once(
    gaussian_map: GaussianMap,
    cameras: Sequence[Camera],
    collection: Collection,
    config: UpdateConfig,
    detector: ChangeDetector | None,
    first_id: int | None,
    on_step: OnStep,
    clock: Clock,
) -> tuple[GaussianMap, list[str | None], UpdateRecord]:
    """Return the updated map, the reason for leaving out each change, or None, and the record."""
    threads, regions, by_change = config.threads, collection.regions, collection.regions_by_change
    training, validation = split_views(collection.views, by_change, config.collect.validation_every)
    record = UpdateRecord(
        kinds=tuple(change.kind for change in collection.changes),
        training_views=len(training),
        validation_views=len(validation),
        skipped=collection.skipped,
    )
    if not collection.changes:
        reasons = dict.fromkeys(reason for _, reason in collection.rejected)
        return gaussian_map, [], _reject(record, "; ".join(reasons) or "nothing changed", clock)

    edit = _pre_edit(gaussian_map, collection, training, config, first_id)
    unsteady = unsteady_share(collection.move(gaussian_map), edit, training)
    clock.note("editing")
    record = record.model_copy(update={"removed": int(edit.removed.sum()), "added": edit.added})
    if unsteady > MAX_UNSTEADY_SHARE:
        reason = f"{100 * unsteady:.0f} % of what changed moved again during the collection"
        return gaussian_map, [], _reject(record, reason, clock)

    kept = [_keeps_object(gaussian_map, edit, own) for own in by_change]
    if any(kept):
        return gaussian_map, kept, record

    refined, counts = _refine(
        gaussian_map, edit, cameras, collection, training, config, detector, on_step
    )
    clock.note("refining")

    groups = (regions, *by_change)
    before = [error_in_regions(gaussian_map, validation, own, threads) for own in groups]
    after = [error_in_regions(refined, validation, own, threads) for own in groups]
    clock.note("verifying")
    record = record.model_copy(
        update={
            **counts,
            "psnr_before_db": _psnr_db(before[0]),
            "psnr_after_db": _psnr_db(after[0]),
            "seconds": clock.stages,
        }
    )
    whole, *by_itself = [_no_better(old, new) for old, new in zip(before, after, strict=True)]
    if all(by_itself):
        return gaussian_map, [], _reject(record, "; ".join(filter(None, by_itself)), clock)
    if whole is not None and not any(by_itself):
        return gaussian_map, [], _reject(record, whole, clock)
    return refined, by_itself, record


def _keeps_object(gaussian_map: GaussianMap, edit: Edit, regions: Sequence[Region]) -> str | None:
    """Return the reason if the Gaussians of a removed object stay; None if most of them left."""
    if [region.side for region in regions] != ["before"]:
        return None
    inside = gaussians_in_regions(gaussian_map, regions, 0.0)
    count, gone = int(inside.sum()), int((inside & edit.removed).sum())
    if gone >= MIN_EMPTIED or gone > MIN_EMPTIED_SHARE * count:
        return None
    return f"its views show only {gone} of {count} Gaussians as gone"


def _pre_edit(
    gaussian_map: GaussianMap,
    collection: Collection,
    views: Sequence[View],
    config: UpdateConfig,
    first_id: int | None,
) -> Edit:
    """Return the map with shifted objects moved, without what is gone, and with what is new."""
    return pre_edit(
        collection.move(gaussian_map),
        views,
        collection.regions_by_change,
        config.edit,
        moved=[bool(rows.any()) for rows in collection.moved],
        first_id=first_id,
        threads=config.threads,
    )


def _refine(
    gaussian_map: GaussianMap,
    edit: Edit,
    cameras: Sequence[Camera],
    collection: Collection,
    views: Sequence[View],
    config: UpdateConfig,
    detector: ChangeDetector | None,
    on_step: OnStep,
) -> tuple[GaussianMap, dict[str, int]]:
    """Return the map refined by some of the views, and the fields of a record that count."""
    regions = collection.regions
    active = active_gaussians(edit, regions, collection.views, config.refine)
    refined = refine_edit(
        gaussian_map, edit, active, cameras, views, regions, config, detector, on_step
    )
    return refined.gaussian_map, {
        "removed": int(edit.removed.sum()),
        "added": edit.added,
        "refined": int(active.sum()) if refined.iterations else 0,
        "iterations": refined.iterations,
    }


def _no_better(old: float | None, new: float | None) -> str | None:
    """Return the reason if an error did not fall enough; None if it did."""
    if old is not None and new is not None and new < MAX_ERROR_SHARE * old:
        return None
    return f"validation views do not fit better: {_describe(old)} before, {_describe(new)} after"


def _reject(record: UpdateRecord, reason: str, clock: Clock) -> UpdateRecord:
    return record.model_copy(update={"rejected": reason, "seconds": clock.stages})


def _psnr_db(error: float | None) -> float | None:
    return None if error is None else psnr_from_mse_db(error)


def _describe(error: float | None) -> str:
    return "no view" if error is None else f"{psnr_from_mse_db(error):.2f} dB"
