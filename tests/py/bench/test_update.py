"""The ablation and the figures of `gslts bench update`."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gslts.update.config import GS_LTS
from gslts_bench.tables import tables_markdown
from gslts_bench.update import run
from gslts_bench.update.methods import ABLATION, METHODS, OURS
from gslts_bench.update.run import CURVE_OF, Record, UpdateUnit
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


def test_methods_are_compared_on_the_same_tasks() -> None:
    methods = {"no update": 20, "plain fine-tuning": 25, "gs_lts editing": 26, "ours": 29}
    easy = [record("a/0", method, near_db) for method, near_db in methods.items()]
    hard = [record("a/1", method, near_db - 10) for method, near_db in methods.items()]
    missed = Record(id="a/2", task="a/2", kind="removal", object_type="Mug", method="not detected")
    curves = [record("a/0", f"curve, {name}", 0, curve={"0": (20, 19)}) for name in CURVE_OF]
    more = record("a/1", "curve, ours", 0, curve={"0": (10, 9)})
    # The last method failed in the second task, and one curve of it.
    found = summarize([*easy, *hard[:-1], missed, *curves, more])
    assert found["tasks"] == 2
    assert found["detected"] == [1, 2]
    overall = {name: numbers["overall"] for name, numbers in found["methods"].items()}
    assert {name: numbers["near"]["psnr_db"] for name, numbers in overall.items()} == methods
    assert found["curves"]["ours"] == {"0": [20, 19], "tasks": [1.0]}
    assert summarize([*easy, *hard])["methods"]["ours"]["overall"]["near"]["psnr_db"] == 24


def update_unit(monkeypatch: pytest.MonkeyPatch, path: Path, *, ablation: bool) -> UpdateUnit:
    """Return work on one task whose maps are made up."""
    change = SimpleNamespace(kind="removal", object_type="Mug")
    detector = SimpleNamespace(detect=lambda _: SimpleNamespace(changes=["mug"]))
    ground = SimpleNamespace(
        home=None, detector=detector, evaluation_views=lambda _: [], lpips=None
    )
    robot = SimpleNamespace(observe=lambda: None)
    task = SimpleNamespace(change=change, start=lambda _home, changed: changed and robot)
    bench = SimpleNamespace(
        name="a",
        mapped_of={},
        work=path,
        tasks=lambda _: [task],
        load=lambda: None,
        map=lambda: None,
    )
    monkeypatch.setattr(run, "_Ground", SimpleNamespace(of=lambda *_: ground))
    monkeypatch.setattr(run, "Report", SimpleNamespace(of=lambda _: None))
    monkeypatch.setattr(run, "fits", lambda *_: True)
    monkeypatch.setattr(run, "collect_views", lambda *_, **__: None)
    monkeypatch.setattr(run, "Judge", lambda *_: SimpleNamespace(scores=lambda _: {}))
    monkeypatch.setattr(run, "compare", lambda *_: np.zeros((4, 4, 3), np.uint8))
    monkeypatch.setattr(UpdateUnit, "_update", lambda *_: (None, {"detected": True}))
    return UpdateUnit(bench, 1, 3, ablation)


def test_a_task_has_its_image_when_its_first_method_has_a_result(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    unit, added = update_unit(monkeypatch, tmp_path, ablation=False), list[dict[str, Any]]()

    def add(result: dict[str, Any]) -> None:
        assert result["error"] is None
        assert unit.image("a/00").is_file()
        added.append(result)

    unit.run(frozenset(), add)
    assert [result["method"] for result in added] == [*METHODS]


def test_methods_of_another_run_do_not_count(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    unit = update_unit(monkeypatch, tmp_path, ablation=False)
    kept = record("a/00", next(iter(ABLATION)), 20)
    assert not unit.is_asked(kept)
    assert replace(unit, ablation=True).is_asked(kept)
    assert unit.is_asked(record("a/00", "ours", 20))
    assert not unit.is_asked(record("a/01", "ours", 20))
