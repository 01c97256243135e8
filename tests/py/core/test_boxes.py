"""Volumes and overlaps of boxes, by hand."""

import numpy as np
import pytest

from gslts.core.boxes import box_iou, common_volume, volume

UNIT = np.array([[0.0, 0, 0], [1, 1, 1]])


def test_volumes_and_iou_by_hand() -> None:
    assert volume(UNIT * 2) == 8
    assert common_volume(UNIT, UNIT + 0.5) == pytest.approx(0.125)
    assert box_iou(UNIT, UNIT) == 1
    assert box_iou(UNIT, UNIT + 0.5) == pytest.approx(0.125 / 1.875)
    assert box_iou(UNIT, UNIT + 2) == 0
    assert box_iou(UNIT * 0, UNIT * 0) == 0
