"""The way from a change to a map that shows it: collect, edit, refine, verify.

Source: GS-LTS, sec. III-D.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gslts.change.changes import Change
from gslts.change.detector import ChangeDetector
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot
from gslts.rendering.metrics import psnr_from_mse_db
from gslts.semantics.map_semantics import MapSemantics
from gslts.store.causes import UpdateRecord
from gslts.types import Bools
from gslts.update.config import UpdateConfig
from gslts.update.edit import Edit, near_regions, pre_edit, sightings
from gslts.update.refine import Refined, Watch, refine, remembered, targets_of
from gslts.update.region import Region
from gslts.update.verify import doubt_left, error_around, split_held_back
from gslts.update.view_collection import Collection, collect
from gslts.update.views import View

Stage = Literal["collecting", "refining"]
Tell = Callable[[Stage], None]
Ints = NDArray[np.int32]

LEAST_AGAINST = 2
"""Views that see a Gaussian, and later or earlier ones that see through it, of one that moved."""
MOST_UNSTEADY = 0.3
"""Share of what comes and goes that may have moved while it was looked at."""
MEANING_M = 0.02
"""Beyond a region, what stays there may mean something else: the table under what is gone."""
WHOLE_SIGMAS = 2
"""A Gaussian is within so many of its standard deviations, nearly."""
SETTLED = 0.5
"""Share of the certainty at which a change is reported that may be left: other frames have other
noise."""
MOST_MORE = 2
"""How often a refinement is repeated where more is left, at most."""
AGREEING = 0.9
"""Share of the views that must agree on when a Gaussian moved: errors come and go."""


@dataclass(frozen=True, eq=False)
class Update:
    """What became of a map.

    Attributes:
        gaussian_map: The updated map, or the one given where the update was rejected.
        changes: That it shows now; none where the update was rejected.
        left: Changes that it does not show, and why.
        record: What was done.
        views: That were collected, those used first.
        regions: Where something changed.
    """

    gaussian_map: GaussianMap
    changes: tuple[Change, ...]
    left: tuple[tuple[Change, str], ...]
    record: UpdateRecord
    views: tuple[View, ...]
    regions: tuple[Region, ...]


def update(
    gaussian_map: GaussianMap,
    cameras: Sequence[Camera],
    changes: Sequence[Change],
    robot: Robot,
    config: UpdateConfig | None = None,
    *,
    detector: ChangeDetector | None = None,
    first_id: int | None = None,
    semantics: MapSemantics | None = None,
    tell: Tell = lambda _: None,
) -> Update:
    """Lets a robot look at changes closely, and brings the map up to date with them.

    Nothing of the map changes but what is near them. A change is left out if too few views of all
    its places can be had, or they do not show it. The map stays as it was if no change is left,
    what changed moves again, or the update fits views that were held back no better.

    Args:
        gaussian_map: float32.
        cameras: Of the frames that it was made of.
        changes: As detected.
        robot: Somewhere near.
        config: Settings; None means the defaults.
        detector: Of the map; None means one with default settings.
        first_id: Of Gaussians that are new; None means the next one after those of the map.
        semantics: Of the map; new Gaussians get semantic features from the frames.
        tell: Is told of each step of the stages that take long.

    Raises:
        ValueError: The map is not float32, or nothing of it would be left.
    """
    config = UpdateConfig() if config is None else config
    clock = _Clock()
    detector = detector or ChangeDetector(gaussian_map, cameras=cameras)
    found = collect(
        robot,
        detector,
        changes,
        config.collect,
        threads=config.threads,
        tell=lambda: tell("collecting"),
    )
    clock.note("collecting")
    updated, record = updated_with(
        gaussian_map,
        cameras,
        found,
        config,
        detector=detector,
        first_id=first_id,
        watch=lambda *_: tell("refining"),
    )
    record = record.model_copy(update={"seconds": {**clock.stages, **record.seconds}})
    used, held_back = split_held_back(found.views, config.collect.held_back)
    if record.rejected is not None:
        left = found.left + tuple((change, record.rejected) for change in found.changes)
        return Update(gaussian_map, (), left, record, (*used, *held_back), found.regions)
    if semantics is not None:
        fresh = ~np.isin(updated.ids, gaussian_map.ids)
        fresh |= near_regions(updated, found.regions, MEANING_M)
        now_at = [  # What moved means what it did.
            region
            for change, own in zip(found.changes, found.regions_of_each, strict=True)
            for region in own
            if change.kind == "relocation" and region.side == "after"
        ]
        moved = near_regions(updated, now_at, config.edit.margin_m)
        fresh &= ~(moved & updated.features.any(axis=1))
        shown = [(view.frame, view.changed) for view in used]
        updated = semantics.update_features(updated, fresh, shown, config.threads)
    return Update(updated, found.changes, found.left, record, (*used, *held_back), found.regions)


def updated_with(
    gaussian_map: GaussianMap,
    cameras: Sequence[Camera],
    found: Collection,
    config: UpdateConfig,
    *,
    detector: ChangeDetector | None = None,
    first_id: int | None = None,
    watch: Watch = lambda *_: None,
) -> tuple[GaussianMap, UpdateRecord]:
    """The part of `update` after the collection: edits, refines and verifies.

    Args:
        gaussian_map: float32.
        cameras: Of the frames that it was made of.
        found: Views of the change.
        config: Settings.
        detector: Of the map; the refinement is repeated while it still sees something in the views
            that were used. None means that the first refinement has to do.
        first_id: See `update`.
        watch: Is told of each step of the refinement.
    """
    clock = _Clock()
    regions, threads = found.regions, config.threads
    used, held_back = split_held_back(found.views, config.collect.held_back)
    record = UpdateRecord(
        kinds=tuple(change.kind for change in found.changes),
        training_views=len(used),
        validation_views=len(held_back),
        skipped=found.skipped,
    )
    if not found.changes:
        why = "; ".join(dict.fromkeys(why for _, why in found.left)) or "nothing changed"
        return gaussian_map, record.model_copy(update={"rejected": why, "seconds": clock.stages})
    edit = pre_edit(
        gaussian_map, used, found.regions_of_each, config.edit, first_id=first_id, threads=threads
    )
    unsteady = unsteady_share(gaussian_map, edit, used)
    clock.note("editing")
    record = record.model_copy(update={"removed": int(edit.removed.sum()), "added": edit.added})
    if unsteady > MOST_UNSTEADY:
        why = f"{100 * unsteady:.0f} % of what changed moved again while it was looked at"
        return gaussian_map, record.model_copy(update={"rejected": why, "seconds": clock.stages})
    moving = moving_of(edit, regions, config.refine.reach_m)
    targets = targets_of(used, regions, config.refine)
    targets += remembered(
        gaussian_map, edit.gaussian_map, cameras, regions, config.refine, threads=threads
    )

    def refine_once(of: GaussianMap) -> Refined:
        return refine(of, targets, moving, config.refine, threads=threads, watch=watch)

    if detector is None:
        refined = refine_once(edit.gaussian_map)
    else:
        cameras_now = [*cameras, *(view.camera for view in used)]
        refined = _refine_until_settled(
            edit.gaussian_map,
            refine_once,
            lambda of: doubt_left(detector.with_map(of, cameras_now), used, regions),
            SETTLED * detector.config.objects.certain,
        )
    clock.note("refining")
    before, after = (
        [error_around(one, held_back, own, threads) for own in (regions, *found.regions_of_each)]
        for one in (gaussian_map, refined.gaussian_map)
    )
    clock.note("verifying")
    record = record.model_copy(
        update={
            "refined": int(moving.sum()) if refined.iterations else 0,
            "iterations": refined.iterations,
            "psnr_before_db": _psnr_db(before[0]),
            "psnr_after_db": _psnr_db(after[0]),
            "seconds": clock.stages,
        }
    )
    for was, now in zip(before, after, strict=True):  # All in all, and each change.
        if was is None or now is None or not now < was:
            why = f"views held back fit no better: {_words(was)} before, {_words(now)} after"
            return gaussian_map, record.model_copy(update={"rejected": why})
    return refined.gaussian_map, record


def _refine_until_settled(
    edited: GaussianMap,
    refine_once: Callable[[GaussianMap], Refined],
    doubt: Callable[[GaussianMap], float],
    most: float,
) -> Refined:
    """Refines a map, and again while that lessens a doubt that is greater than some limit."""
    refined = refine_once(edited)
    left = doubt(refined.gaussian_map)
    for _ in range(MOST_MORE):
        if left <= most:
            break
        more = refine_once(refined.gaussian_map)
        refined = replace(more, iterations=refined.iterations + more.iterations)
        was, left = left, doubt(refined.gaussian_map)
        if left >= was:  # What is left is no matter of refinement.
            break
    return refined


def moving_of(edit: Edit, regions: Sequence[Region], reach_m: float) -> Bools:
    """[N] the Gaussians of an edited map that may move: new ones, and those near regions.

    What reaches farther than views of the regions show would change there unseen.

    Args:
        edit: Whose map it is.
        regions: Where something changed.
        reach_m: How near to a region all of a Gaussian is, to `WHOLE_SIGMAS`.
    """
    gaussian_map = edit.gaussian_map
    centres = gaussian_map.means + gaussian_map.origin
    radii_m = WHOLE_SIGMAS * np.exp(gaussian_map.log_scales.max(axis=1))
    moving = np.zeros(gaussian_map.size, np.bool_)
    for region in regions:
        moving |= region.contains(centres, reach_m - radii_m[:, None])
    moving[moving.size - edit.added :] = True
    return moving


def unsteady_share(before: GaussianMap, edit: Edit, views: Sequence[View]) -> float:
    """Share of what went and came that was there up to some view and not from then on, or not yet.

    Args:
        before: The map before the edit.
        edit: What went and came.
        views: In the order in which they were taken.
    """
    rows = np.arange(edit.gaussian_map.size)
    new = edit.gaussian_map.select(rows >= rows.size - edit.added)
    unsteady = total = 0
    for part in (before.select(edit.removed), new):
        seen = [sightings(part, [view]) for view in views]
        on, through = (np.array(one) for one in zip(*seen, strict=True))
        moved = _moved_once(on, through) | _moved_once(through, on)
        unsteady += int(moved.sum())
        total += part.size
    return unsteady / total if total else 0.0


def _moved_once(first: Ints, then: Ints) -> Bools:
    """[N] whether views [V,N] tell one thing up to one of them and the other from there on."""
    told = first.sum(axis=0) + then.sum(axis=0)
    before = first.cumsum(axis=0)
    after = then.sum(axis=0) - then.cumsum(axis=0)
    enough = (before >= LEAST_AGAINST) & (after >= LEAST_AGAINST)
    moved: Bools = (enough & (before + after >= AGREEING * told)).any(axis=0)
    return moved


class _Clock:
    """Seconds of each stage since the one before."""

    def __init__(self) -> None:
        self.stages: dict[str, float] = {}
        self._last_s = time.perf_counter()

    def note(self, stage: str) -> None:
        """Tells what the time was used for."""
        now_s = time.perf_counter()
        self.stages[stage], self._last_s = round(now_s - self._last_s, 3), now_s


def _psnr_db(error: float | None) -> float | None:
    return None if error is None else psnr_from_mse_db(error)


def _words(error: float | None) -> str:
    return "nothing to compare" if error is None else f"{_psnr_db(error):.2f} dB"
