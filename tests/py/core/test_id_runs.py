"""Runs of ids: the same as the ids themselves, through any edits."""

import numpy as np
import pytest

from gslts.core.id_runs import IdRuns


def test_edits_are_those_of_the_ids() -> None:
    rng = np.random.default_rng(0)
    ids = np.arange(7, 107, dtype=np.uint64)
    runs = IdRuns.of(ids)
    for _ in range(30):
        removed = np.flatnonzero(rng.random(len(ids)) < 0.1)
        added = np.arange(3, dtype=np.uint64) * np.uint64(2) + ids[-1] + np.uint64(1)
        ids = np.concatenate([np.delete(ids, removed), added])
        runs = runs.edit(removed, added)
        assert (runs.size, runs.next_id) == (len(ids), int(ids[-1]) + 1)
        np.testing.assert_array_equal(runs.at(np.arange(len(ids))), ids)
        asked = rng.integers(0, int(ids[-1]) + 3, 200).astype(np.uint64)
        rows, found = runs.find(asked)
        np.testing.assert_array_equal(found, np.isin(asked, ids))
        np.testing.assert_array_equal(ids[rows[found]], asked[found])


def test_all_ids_can_be_removed() -> None:
    runs = IdRuns.of(np.arange(5, dtype=np.uint64))
    empty = runs.edit(np.arange(5), np.zeros(0, np.uint64))
    assert (empty.size, empty.next_id) == (0, 0)
    assert not empty.find(np.array([0, 3], np.uint64))[1].any()
    again = empty.edit(np.zeros(0, np.intp), np.array([9], np.uint64))
    assert again.at(np.array([0])).tolist() == [9]


@pytest.mark.parametrize(
    ("size", "rows", "first_ids"),
    [
        (4, [0, 2], [5, 6]),  # The first run holds 5 and 6.
        (4, [0, 2], [5, 1]),
        (4, [1], [0]),
        (4, [0, 4], [0, 9]),
        (4, [], []),
        (0, [0], [0]),
        (2, [0], [2**64 - 1]),
    ],
)
def test_runs_that_do_not_rise_are_rejected(
    size: int, rows: list[int], first_ids: list[int]
) -> None:
    with pytest.raises(ValueError, match="IdRuns"):
        IdRuns(size, np.array(rows, np.intp), np.array(first_ids, np.uint64))
