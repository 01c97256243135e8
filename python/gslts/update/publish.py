"""The last stage of an update: what came of it becomes a version of the map, or is told."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gslts.change.changes import Change
from gslts.core.camera import Camera, new_viewpoints
from gslts.core.gaussian_map import GaussianMap
from gslts.io.atomic_files import write_atomic
from gslts.localization.landmark_extraction import extract_landmarks
from gslts.localization.landmark_files import has_landmarks, write_landmarks
from gslts.semantics.map_semantics import MapSemantics
from gslts.store.causes import (
    ChangeRecord,
    RejectedUpdateCause,
    UpdateCause,
    UpdateFrame,
    UpdateRecord,
)
from gslts.store.manifest import update_image_path
from gslts.store.map_folder import camera_to_json
from gslts.store.map_store import MapStore
from gslts.store.records import ObjectEvent, Version
from gslts.update.config import UpdateConfig
from gslts.update.edit import near_regions
from gslts.update.object_types import type_of
from gslts.update.region import Region
from gslts.update.report_image import update_picture
from gslts.update.updater import Update

PICTURE_PX, QUALITY = 1200, 85
"""Greatest side of a picture, and how well it is kept: it should not outweigh the version."""
LEAST_GONE, STRAYS = 20, 0.02
"""So many Gaussians tell where something was, and such a share of them may lie beside it."""
LANDMARK_BYTES = 32 << 10
"""Of the landmarks that an update brings, at most: about 500, as many as a picture of it shows."""


def published(
    store: MapStore,
    before: GaussianMap,
    cameras: Iterable[Camera],
    result: Update,
    config: UpdateConfig,
    number_of_round: int | None = None,
    semantics: MapSemantics | None = None,
) -> Version | None:
    """Adds a version of an updated map, and a picture of it; of what stays as it was, only why.

    A map with landmarks gets those of what is new, too.

    Args:
        store: Writable.
        before: Its newest version, which was updated.
        cameras: That it was made from.
        result: Of the update.
        config: It was made with.
        number_of_round: Round of the robot, counted from 0; None outside of rounds.
        semantics: Of the map; names the objects that are gone.

    Raises:
        OSError: It cannot be written; then the newest version is what it was, or only the picture
            is missing.
        ValueError: What is known of the map is damaged.
    """
    if result.record.rejected is not None:
        changes = tuple(_record_of(change) for change, _ in result.left)
        store.add_rejection(
            RejectedUpdateCause(round=number_of_round, changes=changes, record=result.record)
        )
        return None
    seen_from = [view.camera for view in result.views]
    frames = tuple(
        UpdateFrame(**camera_to_json(camera), new_viewpoint=new)
        for camera, new in zip(seen_from, new_viewpoints(cameras, seen_from), strict=True)
    )
    digest = None
    if has_landmarks(store.folder):
        used = result.views[: result.record.training_views]
        landmarks = extract_landmarks(
            result.gaussian_map,
            [view.frame for view in used],
            [view.changed for view in used],
            max_bytes=LANDMARK_BYTES,
            threads=config.threads,
        )
        # Views from all sides also see more of what was there before.
        new = ~np.isin(landmarks.gaussians, before.ids)
        landmarks = landmarks.select(np.flatnonzero(new))
        if landmarks.size:
            digest = write_landmarks(landmarks, store.folder)
    standing = store.lineage_numbers()  # What others brought was undone by a restore.
    past = [event for event in store.events() if event.version in standing]

    vanished = ~np.isin(before.ids, result.gaussian_map.ids)

    def gone_from(region: Region) -> NDArray[np.intp]:
        return np.flatnonzero(vanished & near_regions(before, [region], 0.0))

    def named(region: Region) -> str | None:
        return None if semantics is None else semantics.name_of(before, gone_from(region))

    def boxes(change: Change) -> tuple[Any, Any]:
        """What is gone is where its Gaussians were: a look may take for it what is behind."""
        first, after = _boxes(change)
        if change.boxes[0] is None:
            return first, after
        rows = gone_from(Region("before", *change.boxes[0]))
        if len(rows) >= LEAST_GONE:
            centres = before.means[rows] + before.origin
            first = np.quantile(centres, (STRAYS, 1 - STRAYS), axis=0).tolist()
        return first, after

    events = [
        ObjectEvent(kind=one.kind, type=type_of(one, result.views, past, named), boxes=boxes(one))
        for one in result.changes
    ]
    cause = UpdateCause(
        round=number_of_round,
        changes=tuple(_record_of(change) for change in result.changes),
        record=result.record,
        config=config.model_dump(mode="json"),
        frames=frames,
        landmarks=digest,
    )
    version = store.commit(result.gaussian_map, cause, events)
    for change, why in result.left:
        store.add_rejection(
            RejectedUpdateCause(
                round=number_of_round,
                changes=(_record_of(change),),
                record=UpdateRecord(rejected=why),
            )
        )
    picture = Image.fromarray(
        update_picture(before, result.gaussian_map, result.views, config.threads)
    )
    picture.thumbnail((PICTURE_PX, PICTURE_PX))
    path = update_image_path(store.folder, version.number)
    content = BytesIO()
    picture.save(content, "JPEG", quality=QUALITY)
    try:
        path.parent.mkdir(exist_ok=True)
        write_atomic(path, content.getvalue())
    except OSError as error:
        now = f"{store.folder} is version {version.number} now, but without a picture"
        raise OSError(f"{now}: {error}") from error
    return version


def _record_of(change: Change) -> ChangeRecord:
    return ChangeRecord(kind=change.kind, confidence=change.confidence, boxes=_boxes(change))


def _boxes(change: Change) -> tuple[Any, Any]:
    before, after = (
        None if box is None else [corner.tolist() for corner in box] for box in change.boxes
    )
    return before, after
