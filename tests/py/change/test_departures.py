"""Objects that came by updates are likelier to go than other things."""

import numpy as np
import pytest

from gslts._core.detect import Side, Surface
from gslts.change.departures import are_in, expect_departures, find_added


def surface(label: int, side: Side, confidence: float | None) -> Surface:
    """Return a surface of a region, or one of fine depth if it has no confidence."""
    point = (0, 0, 1)
    return Surface(
        side=side, point=point, low=point, high=point, label=label, color_confidence=confidence
    )


def test_ids_are_in_ranges() -> None:
    ids = np.array([0, 4, 5, 9, 10, 2**60], np.uint64)
    assert are_in(ids, []).tolist() == [False] * 6
    expected = [True, False, True, True, False, False]
    assert are_in(ids, [range(1), range(5, 5), range(5, 10)]).tolist() == expected
    ranges = [range(k, k + 3) for k in range(0, 1000, 7)]
    many = np.arange(1100, dtype=np.uint64)
    inside = set().union(*ranges)
    assert are_in(many, ranges).tolist() == [k in inside for k in range(1100)]


def test_only_regions_of_what_came_are_raised() -> None:
    labels = np.repeat(np.arange(6, dtype=np.int32), 4).reshape(6, 4)
    came = np.zeros(labels.shape, np.float32)
    came[1:3, :2] = 1  # Half of the regions 1 and 2.
    came[3, 0] = 1
    came[4:] = 1
    surfaces = [
        surface(1, Side.BEFORE, 0.2),
        surface(2, Side.AFTER, 0.2),
        surface(3, Side.BEFORE, 0.2),
        surface(4, Side.BEFORE, None),
        surface(9, Side.BEFORE, 0.2),
    ]
    added = find_added(surfaces, labels, came)
    assert added == {1, 4}
    expect_departures(surfaces, added)
    odds = np.exp(2) * 0.2 / 0.8
    assert surfaces[0].color_confidence == pytest.approx(odds / (1 + odds))
    assert [s.color_confidence for s in surfaces[1:]] == [0.2, 0.2, None, 0.2]


@pytest.mark.parametrize("confidence", [0.0, 1e-12, 1 - 1e-12, 1 - 2**-53, 1.0])
def test_confidences_stay_probabilities(confidence: float) -> None:
    changed = surface(1, Side.BEFORE, confidence)
    expect_departures([changed], {1})
    assert changed.color_confidence is not None
    assert confidence <= changed.color_confidence <= 1
