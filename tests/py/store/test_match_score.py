"""Scores of reported objects: that of the detector, from what a history keeps."""

import numpy as np
import pytest

from gslts._core.detect import Side, Surface, match_score
from gslts.change.changes import Change
from gslts.store.causes import Box
from gslts.store.match_score import is_at, report_score
from gslts.store.match_score import match_score as score_of_history
from gslts.update.object_events import change_record

BINS = 2304
LOW, HIGH = np.zeros(3), np.array([0.3, 0.2, 0.1])
BOX: Box = ((0.0, 0.0, 0.0), (0.3, 0.2, 0.1))


def surface(rng: np.random.Generator, near: np.ndarray | None = None) -> Surface:
    """Return a surface with a histogram of few colours, in part those of another one."""
    shares = np.zeros(BINS)
    shares[rng.choice(BINS, 40, replace=False)] = rng.random(40)
    if near is not None:
        shares = rng.uniform(0, 0.3) * shares / shares.sum() + near
    return Surface(
        side=Side.AFTER,
        point=(LOW + HIGH) / 2,
        low=LOW,
        high=HIGH,
        color_histogram=(shares / shares.sum()).astype(np.float32).tolist(),
    )


@pytest.mark.parametrize("seed", range(20))
def test_the_score_is_that_of_the_detector(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first = surface(rng)
    near = np.asarray(first.color_histogram) if seed % 2 else None
    second = surface(rng, near)
    appearances = []
    for seen in (first, second):
        change = Change("addition", 0.9, seen.point, (None, (LOW, HIGH)), after=seen)
        appearance = change_record(change).appearances[1]
        assert appearance is not None
        appearances.append(appearance)
    expected = match_score(first, second)
    assert score_of_history(*appearances) == pytest.approx(expected, abs=0.02)
    assert (expected > 0.5) == bool(seed % 2), "pairs of both kinds"


def test_a_change_without_a_surface_has_no_appearance() -> None:
    change = Change("addition", 0.9, (LOW + HIGH) / 2, (None, (LOW, HIGH)))
    assert change_record(change).appearances == (None, None)


def test_objects_of_very_different_size_are_not_alike() -> None:
    small: Box = ((0.0, 0.0, 0.0), (0.05, 0.02, 0.02))
    assert report_score((BOX, BOX), (None, None), same_type=True) > 0
    assert report_score((BOX, small), (None, None), same_type=True) == 0


def test_boxes_of_one_position_overlap_or_nearly_do() -> None:
    beside: Box = ((0.4, 0.0, 0.0), (0.6, 0.2, 0.1))
    above: Box = ((0.0, 0.0, 1.0), (0.3, 0.2, 1.1))
    assert is_at(BOX, BOX)
    assert not is_at(BOX, beside)
    assert not is_at(BOX, above)
    assert is_at(BOX, above, parts=True)
    assert not is_at(BOX, None)
