"""Changes as plain values, such as another detector constructs."""

import numpy as np
import pytest

from gslts.change.changes import Change

POINT = np.array([1.0, 2.0, 0.5])
BOX = (np.array([0.8, 1.8, 0.4]), np.array([1.2, 2.2, 0.8]))
OTHER_BOX = (np.array([2.8, 1.8, 0.4]), np.array([3.2, 2.2, 0.8]))
MASK = np.ones((3, 4), np.bool_)


def test_a_change_needs_kind_confidence_and_point_only() -> None:
    change = Change("addition", 0.8, POINT)
    assert change.boxes == change.masks == (None, None)
    assert change.before is change.after is change.end_point("after") is None


def test_a_relocation_of_boxes_has_two_ends() -> None:
    whole = Change("relocation", 0.7, POINT, (BOX, OTHER_BOX), (MASK, ~MASK))
    removal, addition = whole.end("before"), whole.end("after")
    assert (removal.kind, addition.kind) == ("removal", "addition")
    assert removal.boxes == (BOX, None)
    assert addition.boxes == (None, OTHER_BOX)
    assert removal.masks[0] is MASK
    assert removal.masks[1] is addition.masks[0] is None
    np.testing.assert_allclose(removal.point, (1.0, 2.0, 0.6))
    np.testing.assert_allclose(addition.point, (3.0, 2.0, 0.6))
    assert removal.confidence == addition.confidence == 0.7


def test_a_shift_has_a_rigid_motion_and_two_ends() -> None:
    motion = np.eye(4)
    motion[0, 3] = 0.05
    shift = Change("shift", 0.9, POINT, (BOX, BOX), motion=motion)
    assert shift.motion is motion
    assert (shift.end("before").kind, shift.end("after").kind) == ("removal", "addition")
    assert shift.end("before").motion is None


def test_boxes_of_two_changes_overlap_at_one_side() -> None:
    half = (BOX[0], np.array([1.0, 2.2, 0.8]))
    removal, addition = Change("removal", 1, POINT, (BOX, None)), Change("addition", 1, POINT)
    whole = Change("relocation", 1, POINT, (half, OTHER_BOX))
    assert removal.box_iou(whole) == whole.box_iou(removal) == pytest.approx(0.5)
    assert whole.box_iou(whole) == 1
    assert removal.box_iou(Change("removal", 1, POINT, (OTHER_BOX, None))) == 0
    assert addition.box_iou(whole) == 0
    flat = Change("removal", 1, POINT, ((BOX[0], BOX[0]), None))
    assert flat.box_iou(flat) == 0


def test_an_end_at_an_unknown_position_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"Change\.end: the relocation has no box before"):
        Change("relocation", 0.7, POINT).end("before")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kind": "move"}, "kind must be one of addition, removal, relocation, shift, got 'move'"),
        ({"confidence": 1.5}, r"confidence must be in \[0, 1\], got 1.5"),
        ({"confidence": float("nan")}, r"confidence must be in \[0, 1\], got nan"),
        ({"point": np.zeros(2)}, "point: expected three finite numbers"),
        ({"point": np.full(3, np.nan)}, "point: expected three finite numbers"),
        ({"boxes": (None, BOX[::-1])}, "boxes: after: low must not exceed high"),
        ({"boxes": (None, (*BOX, POINT))}, r"boxes: after: expected \(low, high\), got 3 corners"),
        ({"boxes": (BOX, None)}, "boxes: addition has nothing before the change"),
        ({"masks": (MASK, None)}, "masks: addition has nothing before the change"),
        ({"kind": "removal", "boxes": (None, BOX)}, "boxes: removal has nothing after the change"),
        ({"kind": "shift"}, "motion: a shift needs one, other kinds have none, got shift"),
        ({"motion": np.eye(4)}, "motion: a shift needs one, other kinds have none, got addition"),
        ({"kind": "shift", "motion": np.eye(3)}, r"motion: expected \[4,4\] finite numbers"),
        ({"kind": "shift", "motion": 2 * np.eye(4)}, "motion: expected a rigid transform"),
        (
            {"kind": "shift", "motion": np.diag([1.0, 1.0, -1.0, 1.0])},
            "motion: expected a rigid transform",
        ),
    ],
)
def test_values_that_do_not_fit_are_named(values: dict, message: str) -> None:
    with pytest.raises(ValueError, match=f"^Change: {message}"):
        Change(**{"kind": "addition", "confidence": 0.5, "point": POINT, **values})
