"""The ablation and the figures of `gslts bench update`."""

from typing import Any

import pytest

from gslts.update.config import GS_LTS
from gslts_bench.tables import tables_markdown
from gslts_bench.update.methods import ABLATION, OURS
from gslts_bench.update.run import Record
from gslts_bench.update.tables import summarize, tabulate


def test_each_of_the_ablation_changes_one_thing() -> None:
    for name, method in ABLATION.items():
        if name == "plain, our rates":
            continue
        assert method.edit is not None
        assert method.refine is not None
        if method.edit == GS_LTS:
            assert method.refine == OURS.refine
            continue
        edits = {k: v for k, v in method.edit if v != getattr(OURS.edit, k)}
        refinements = {k: v for k, v in method.refine if v != getattr(OURS.refine, k)}
        assert len(edits) + len(refinements) == 1


def record(task: str, method: str, near_db: float, **more: Any) -> Record:
    score = {
        "psnr_db": near_db,
        "ssim": 0.9,
        "flip": 0.1,
        "lpips": None,
        "outside_db": 30.0,
        "true_pose_db": 25.0,
    }
    return Record(
        id=f"{task}: {method}",
        task=task,
        kind="removal",
        object_type="Mug",
        method=method,
        detected=True,
        scores={"near": score, "far": {**score, "psnr_db": near_db - 1}},
        gaussians=(100, 110),
        seconds={"update": 2.0, "editing": 0.5, "refining": 1, "verifying": 0, "collecting": 3},
        **more,
    )


def test_gains_and_growth_are_those_of_the_records() -> None:
    found = summarize(
        [
            record("a/0", "no update", 20),
            record("a/0", "plain fine-tuning", 25),
            record("a/0", "gs_lts editing", 26),
            record("a/0", "ours", 29),
            Record(id="a/1", task="a/1", kind="addition", object_type="Mug", method="not detected"),
        ]
    )
    assert found["tasks"] == 2
    assert found["detected"] == [1, 2]
    assert found["methods"]["ours"]["removal"]["far"]["psnr_db"] == 28
    assert found["ours"]["growth"] == pytest.approx(0.1)
    assert found["ours"]["rejected"] == [0, 1]
    text = tables_markdown(tabulate(found))
    assert "| `ours` over plain fine-tuning, near | +4.00 dB | +3 |" in text
    assert "| edit and refinement, median | 1.50 s |  |" in text
    assert "LPIPS" not in text
