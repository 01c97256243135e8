"""Types of changed objects, from labels and from the history."""

from dataclasses import replace

import numpy as np
import pytest
import update_room

from gslts.core.frame import Labels, RgbdFrame
from gslts.store.records import Event
from gslts.update.object_types import UNKNOWN, object_type

BOX = [corner.tolist() for corner in update_room.REMOVED]


def views_with(types: dict[str, str]) -> list:
    """Return the views of the added yellow box with other types in the labels."""
    views = []
    for view in update_room.collected("addition").views:
        labels = view.frame.labels
        assert labels is not None
        named = Labels(labels.instances, tuple(types.get(name, name) for name in labels.types))
        views.append(replace(view, frame=replace(view.frame, labels=named)))
    return views


def test_an_added_object_has_the_type_of_its_labels() -> None:
    change = update_room.detected("addition")
    assert object_type(change, update_room.collected("addition").views, []) == "Box"
    assert object_type(change, views_with({"Box": "Mug"}), []) == "Mug"


def test_a_removed_object_has_the_type_of_the_last_addition() -> None:
    change, views = update_room.detected("removal"), update_room.collected("removal").views
    far = [(np.array(corner) + 1).tolist() for corner in BOX]
    mug, cup, pot = (
        Event(version=number, kind="addition", type=name, boxes=(None, box))
        for number, (name, box) in enumerate([("Mug", BOX), ("Cup", BOX), ("Pot", far)], start=2)
    )
    assert object_type(change, views, []) == UNKNOWN
    assert object_type(change, views, [mug, cup, pot]) == "Cup"
    assert object_type(change, views, [pot]) == UNKNOWN
    unknown = cup.model_copy(update={"type": UNKNOWN})
    assert object_type(change, views, [mug, unknown]) == "Mug"
    mug_left, left = (
        Event(version=5, kind="removal", type=name, boxes=(BOX, None)) for name in ("Mug", UNKNOWN)
    )
    assert object_type(change, views, [cup, mug, mug_left]) == "Cup"
    assert object_type(change, views, [mug, left]) == UNKNOWN
    assert object_type(change, views, [mug, mug_left, cup]) == "Cup"


def test_without_labels_the_type_is_unknown() -> None:
    change = update_room.detected("addition")
    views = [
        replace(view, frame=replace(view.frame, labels=None))
        for view in update_room.collected("addition").views
    ]
    assert object_type(change, views, []) == UNKNOWN


@pytest.mark.parametrize(
    ("instances", "message"),
    [
        (np.zeros((2, 2), np.int64), r"Labels: instances: expected int32 \[H,W\], got int64"),
        (np.zeros(4, np.int32), r"Labels: instances: expected int32 \[H,W\]"),
        (np.full((2, 2), 1, np.int32), r"Labels: instances: must be in -1\.\.0"),
        (np.full((2, 2), -2, np.int32), r"Labels: instances: must be in -1\.\.0"),
    ],
)
def test_bad_labels_are_rejected(instances: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Labels(instances, ("Mug",))


def test_labels_have_the_size_of_the_frame() -> None:
    frame = update_room.collected("addition").views[0].frame
    labels = Labels(np.zeros((2, 2), np.int32), ("Mug",))
    with pytest.raises(ValueError, match=r"RgbdFrame: labels: expected \(120, 160\), got \(2, 2\)"):
        RgbdFrame(frame.rgb, frame.depth, frame.camera, labels=labels)
