"""Publication of an update: a new version of the map on disk, or the record of its rejection."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.io.atomic_files import write_atomic
from gslts.io.image_files import encode_jpeg, shrink_image
from gslts.localization.landmark_extraction import extract_landmarks
from gslts.localization.landmark_files import has_landmarks, write_landmarks
from gslts.semantics.map_semantics import MapSemantics
from gslts.store.camera_files import frame_records
from gslts.store.causes import RejectedUpdateCause, UpdateCause, UpdateRecord
from gslts.store.manifest import update_image_path
from gslts.store.map_store import MapStore
from gslts.store.records import Version
from gslts.update.config import UpdateConfig
from gslts.update.integrate import UpdateResult
from gslts.update.object_events import change_record, object_events
from gslts.update.report_image import draw_update

MAX_IMAGE_PX, JPEG_QUALITY = 1200, 75
"""Longest side of the image of an update, px, and its quality: the image takes fewer bytes than the
version, and a shared map takes 0.3 MB for an update of 3,000 Gaussians."""
MAX_LANDMARK_BYTES = 32 << 10
"""Maximum size of the landmarks of one update, bytes: about 500 landmarks, as many as one image of
it shows."""


def publish(
    store: MapStore,
    before: GaussianMap,
    cameras: Iterable[Camera],
    result: UpdateResult,
    config: UpdateConfig,
    number_of_round: int | None = None,
    semantics: MapSemantics | None = None,
) -> Version | None:
    """Commit an accepted update with its image, or record a rejected one.

    Landmarks of added objects are written if the map has landmarks.

    Args:
        store: Writable.
        before: Newest version of the map.
        cameras: Training cameras of the map.
        result: Of the update.
        config: Settings of the update.
        number_of_round: Round of the robot, counted from 0; None outside of rounds.
        semantics: Of the map; names removed objects.

    Returns:
        The new version; None if the update was rejected.

    Raises:
        OSError: A file cannot be written. Then the newest version is still the old one, or only the
            image is missing, as the message says.
        ValueError: The history of the map is damaged.
    """
    if result.rejected is not None:
        changes = tuple(change_record(change) for change, _ in result.rejected_changes)
        store.add_rejection(
            RejectedUpdateCause(round=number_of_round, changes=changes, record=result.record)
        )
        return None
    cause = UpdateCause(
        round=number_of_round,
        changes=tuple(change_record(change) for change in result.changes),
        record=result.record,
        config=config.model_dump(mode="json"),
        frames=frame_records(cameras, [view.camera for view in result.views]),
        landmarks=_write_landmarks(store, before, result, config.threads),
    )
    lineage = store.lineage_numbers()  # A restore undid the events of other versions.
    events = [event for event in store.events() if event.version in lineage]
    version = store.commit(result.delta, cause, object_events(before, result, events, semantics))
    for change, reason in result.rejected_changes:
        store.add_rejection(
            RejectedUpdateCause(
                round=number_of_round,
                changes=(change_record(change),),
                record=UpdateRecord(rejected=reason),
            )
        )
    _write_image(store, version, before, result, config.threads)
    return version


def _write_landmarks(
    store: MapStore, before: GaussianMap, result: UpdateResult, threads: int
) -> str | None:
    """Write the landmarks of new Gaussians, and return the SHA-256 of the file; None if none."""
    if not has_landmarks(store.folder):
        return None
    training = result.views[: result.record.training_views]
    landmarks = extract_landmarks(
        result.part,
        [view.frame for view in training],
        [view.changed for view in training],
        max_bytes=MAX_LANDMARK_BYTES,
        threads=threads,
    )
    # The views also show landmarks of old Gaussians, which the map has already.
    landmarks = landmarks.select(np.flatnonzero(landmarks.gaussians >= before.next_id))
    return write_landmarks(landmarks, store.folder) if landmarks.size else None


def _write_image(
    store: MapStore, version: Version, before: GaussianMap, result: UpdateResult, threads: int
) -> None:
    """Write the image of an update: frames, and the map before and after."""
    image = draw_update(before, result.part, result.views, threads)
    content = encode_jpeg(shrink_image(image, (MAX_IMAGE_PX, MAX_IMAGE_PX)), JPEG_QUALITY)
    path = update_image_path(store.folder, version.number)
    try:
        path.parent.mkdir(exist_ok=True)
        write_atomic(path, content)
    except OSError as error:
        state = f"{store.folder} is version {version.number} now, but without an image"
        raise OSError(f"{state}: {error}") from error
