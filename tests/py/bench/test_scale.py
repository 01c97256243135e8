"""Benchmark of scale: large maps of one room, and the table of their costs."""

import numpy as np
from store_maps import random_map

from gslts_bench.scale.run import STAGES, Record
from gslts_bench.scale.tables import summarize, tabulate
from gslts_bench.scale.tile import tile_room


def test_rooms_are_side_by_side() -> None:
    room = random_map(400)
    tiled = tile_room(room, 9)
    assert tiled.size == 9 * 400
    assert (np.diff(tiled.ids.astype(np.int64)) > 0).all()
    offsets = (tiled.means.reshape(9, 400, 3) - room.means).mean(axis=1)
    low, high = np.percentile(room.means, [0.5, 99.5], axis=0)
    cells = np.rint(offsets / (high - low + 0.3)).astype(int)
    assert sorted(map(tuple, cells)) == [(x, y, 0) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    assert (np.abs(np.diff(cells, axis=0)).sum(axis=1) == 1).all()
    assert np.array_equal(tiled.means[:400], room.means)
    assert np.array_equal(tiled.sh[-400:], room.sh)
    assert tile_room(room, 1).size == 400


def test_table_has_factors_over_the_smallest_map() -> None:
    records = [
        Record(
            id=f"kitchen_0: {factor}",
            home="kitchen_0",
            rooms=factor,
            gaussians=1000 * factor,
            seconds=dict.fromkeys(STAGES, 0.01 * factor),
            memory_mib=100.0 * factor,
        )
        for factor in (2, 1)
    ]
    (table,) = tabulate(summarize(records))
    assert [row[:2] for row in table.rows] == [["1", "1,000"], ["2", "2,000"]]
    assert table.rows[1][2:] == [*["20 (2.00)"] * len(STAGES), "200 (2.00)"]
