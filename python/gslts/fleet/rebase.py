"""Own versions of a clone, committed again after the versions that others made meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.fleet.replica import OwnVersion, Replica
from gslts.fleet.same_region import Attempt
from gslts.fleet.shared_version import SharedVersion
from gslts.fleet.verification import Verdict, reject_all, verify_anew
from gslts.localization.landmark_files import read_landmark_file, write_landmarks
from gslts.store.causes import ConsolidationCause, ExtensionCause, UpdateCause, ViewsCause
from gslts.store.delta import Delta, apply_deltas
from gslts.store.measurement_files import read_measurement_file, write_measurements
from gslts.types import UInts64

AGAIN = "others changed the map before; run gslts {} again"
"""Reason to give up what was computed for the map as it was."""


@dataclass
class Rebased:
    """Outcome of `rebase`.

    Attributes:
        replayed: Number of own versions that follow those of others now.
        given_up: Reason for each change that the map does not show any more.
        images: Images of the replayed versions, JPEG, by new number.
    """

    replayed: int = 0
    given_up: list[str] = field(default_factory=list)
    images: dict[int, bytes] = field(default_factory=dict)


def rebase(
    replica: Replica, after: int, theirs: Sequence[SharedVersion], own: Sequence[OwnVersion]
) -> Rebased:
    """Commit own versions again, after those of others.

    Args:
        replica: Clone whose newest version is the last of `theirs`.
        after: Number of the last version before `theirs` and `own`.
        theirs: Versions of others.
        own: Own versions, oldest first.

    Returns:
        The outcome. What is given up is recorded as rejected.

    Raises:
        OSError: A file cannot be read or written.
        ValueError: A file is damaged, or was removed by compaction.
    """
    rebased = Rebased()
    if not own:
        return rebased
    first_id = replica.version(after).next_id
    ids = _NewIds(first_id, replica.version().next_id - first_id)
    before, head = replica.read(after), replica.read()
    lost: str | None = None
    for item in own:
        cause = item.version.cause
        if lost is None and isinstance(cause, ViewsCause):
            delta = ids.of_delta(replica.read_delta(item.version))
            attempt = Attempt(item, cause, delta, before, head, theirs)
            verdict = _judge(replica, attempt)
            before = attempt.after
            if verdict.delta is not None:
                head = apply_deltas(head, [verdict.delta])
                _commit(replica, attempt, verdict, ids, rebased)
        else:
            # What was restored or computed for the whole map does not fit the map of others.
            lost = lost or AGAIN.format(cause.kind)
            verdict = reject_all(cause, lost)
        for rejected in verdict.rejected:
            replica.reject_again(item.version, rejected)
            rebased.given_up.append(rejected.reason)
        for rejection in item.later_rejections:
            replica.reject_again(rejection, rejection.cause)
    return rebased


def _judge(replica: Replica, attempt: Attempt) -> Verdict:
    """Decide which changes of a version can follow the newest version of others."""
    if isinstance(attempt.cause, ConsolidationCause):  # Of changes all over the map.
        return reject_all(attempt.cause, AGAIN.format("consolidate"))
    if attempt.delta.added.feature_dims != attempt.head.feature_dims:
        return reject_all(attempt.cause, "the map has other semantic features; observe it again")
    if attempt.is_elsewhere:
        return Verdict(attempt.delta, tuple(range(len(attempt.changes))))
    return verify_anew(replica, attempt)


def _commit(
    replica: Replica, attempt: Attempt, verdict: Verdict, ids: _NewIds, rebased: Rebased
) -> None:
    """Commit the changes of a version that were not given up."""
    item, cause = attempt.own, attempt.cause
    assert verdict.delta is not None
    assert isinstance(cause, UpdateCause | ExtensionCause)
    landmarks, events = cause.landmarks, item.events
    if landmarks is not None:
        added = read_landmark_file(replica.folder, landmarks)
        added = replace(added, gaussians=ids.of(added.gaussians))
        added = added.of_gaussians(verdict.delta.added)
        landmarks = write_landmarks(added, replica.folder) if added.size else None
    made: dict[str, object] = {"landmarks": landmarks}
    if isinstance(cause, ExtensionCause) and cause.measurements is not None:
        measured = read_measurement_file(replica.folder, cause.measurements)
        measured = replace(measured, ids=ids.of(measured.ids))
        made["measurements"] = write_measurements(measured, replica.folder)
    if isinstance(cause, UpdateCause):
        made["changes"] = tuple(cause.changes[row] for row in verdict.kept)
        if len(events) == len(cause.changes):
            events = tuple(events[row] for row in verdict.kept)
    version = replica.commit_again(
        item.version, verdict.delta, cause.model_copy(update=made), events
    )
    rebased.replayed += 1
    if item.image is not None:
        rebased.images[version.number] = item.image


@dataclass(frozen=True)
class _NewIds:
    """Ids of own Gaussians that others have not used.

    Attributes:
        first: Own new Gaussians have this id or a higher one.
        offset: Added to their ids.
    """

    first: int
    offset: int

    def of(self, ids: UInts64) -> UInts64:
        return np.where(ids >= self.first, ids + np.uint64(self.offset), ids)

    def of_delta(self, delta: Delta) -> Delta:
        return Delta(self.of(delta.removed), self._of_map(delta.added), self._of_map(delta.changed))

    def _of_map(self, gaussian_map: GaussianMap) -> GaussianMap:
        return replace(gaussian_map, ids=self.of(gaussian_map.ids))
