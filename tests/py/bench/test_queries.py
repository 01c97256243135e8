"""Scores of `gslts bench queries`."""

from pathlib import Path

import numpy as np
import pytest

from gslts.semantics.queries import Instance
from gslts_bench.queries.run import OURS, Found, Record, Variant, best_ious
from gslts_bench.queries.tables import summarize, tabulate
from gslts_bench.tables import tables_markdown

UNIT = np.array([[0.0, 0, 0], [1, 1, 1]])


def instance(low: float, high: float) -> Instance:
    box = np.full(3, low), np.full(3, high)
    return Instance(*box, np.zeros((4, 2)), 0.7, np.arange(3))


def test_an_instance_serves_one_object() -> None:
    boxes, found = [UNIT, UNIT + 0.1], instance(0, 1)
    assert sorted(best_ious(boxes, [found])) == [0, 1]
    assert best_ious(boxes, []) == [0, 0]
    assert best_ious([], [found]) == []


def test_the_summary_counts_all_objects() -> None:
    def record(*ious: float) -> Record:
        found = [
            Found(object_id=f"Sofa|{k}", category="Sofa", iou=iou) for k, iou in enumerate(ious)
        ]
        return Record(id=OURS, home="x", variant=OURS, found=tuple(found), query_s=(0.1,))

    found = summarize([record(0.2, 0.4), record(0.9), record()])
    assert found[OURS]["mIoU"] == pytest.approx(0.5)
    assert found[OURS]["Acc@0.5"] == pytest.approx(1 / 3)
    assert found[OURS]["Acc@0.3"] == pytest.approx(2 / 3)
    assert "| Sofa | 3 | 0.500 | 0.333 | 0.667 |" in tables_markdown(tabulate(found))


def test_variants_are_recorded_as_they_want() -> None:
    from gslts_bench.homes import BenchHome, HomeSetup

    bench = BenchHome("kitchen", 3, HomeSetup(frames=50, code={}), Path())
    assert Variant(frames_share=0.6).home(bench).setup.frames == 30
    small = Variant(width=320, height=240).home(bench).setup
    assert (small.width, small.height, small.frames) == (320, 240, 50)
