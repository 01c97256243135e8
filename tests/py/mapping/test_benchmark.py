"""Table of the mapping benchmark: cells without a measurement stay empty."""

import importlib.util
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(BENCHMARKS)
    spec = importlib.util.spec_from_file_location(
        "mapping_benchmark", BENCHMARKS / "mapping_benchmark.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.modules.pop("machine", None)


def quality(psnr_db: float, depth_l1_m: float | None) -> dict[str, Any]:
    return {"frames": 8, "psnr_db": psnr_db, "ssim": 0.9, "depth_l1_m": depth_l1_m}


def result(depth_l1_m: float | None, by_neighbours: dict[str, Any] | None) -> dict[str, Any]:
    return {
        "given": quality(27.0, depth_l1_m),
        "by_neighbours": by_neighbours,
        "refined": quality(28.0, depth_l1_m),
        "gaussians": 1000,
        "variants": {},
        "seconds": 9.0,
        "lpips": None,
        "skipped": [],
    }


def test_rows_without_depth_or_neighbours(benchmark: ModuleType) -> None:
    photographs = result(None, None)
    line = "| {} | 27.00 | {} | 28.00 | 0.900 | 0.900 | {} | {} | 1000 |  | 9 |"
    assert benchmark.row("a", photographs) == line.format("a", "", "", "")
    assert benchmark.row("a", photographs).count("|") == benchmark.HEADER.splitlines()[1].count("|")
    measured = result(0.02, quality(27.5, 0.02))
    assert benchmark.row("b", measured) == line.format("b", "27.50", "2.00", "2.00")
    both = benchmark.mean_of([measured, measured])
    assert benchmark.row("mean", both) == line.format("mean", "27.50", "2.00", "2.00")
    for pair in ([measured, photographs], [photographs, measured]):
        row = benchmark.row("mean", benchmark.mean_of(pair))
        assert row == line.format("mean", "", "", "")


def test_leftovers_of_a_stopped_run_are_removed(
    benchmark: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "map_room_fast_growth=0.5"
    stale = tmp_path / f"{out.name}.checkpoint.npz"

    def gslts(verb: str, *_: object) -> str:
        if verb == "map":
            assert not stale.exists()
            assert not out.exists()
            out.mkdir()
            manifest = {"seconds": {"reading": 1.0, "evaluation": 5.0}, "variants": []}
            (out / "manifest.json").write_text(json.dumps(manifest))
        return json.dumps(result(None, None))

    monkeypatch.setattr(benchmark, "gslts", gslts)
    for _ in range(2):
        stale.write_bytes(b"")
        found = benchmark.map_and_evaluate(tmp_path / "set", tmp_path / "set", "fast", [], out)
    assert found["seconds"] == 1.0


def test_photographs_have_no_depth(benchmark: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "set").mkdir()
    frames = [{"file_path": "a.png", "depth_file_path": "b.png"}, {"file_path": "c.png"}]
    (tmp_path / "set" / "transforms.json").write_text(json.dumps({"frames": frames}))
    path = benchmark.without_depth(tmp_path / "set")
    written = json.loads((path / "transforms.json").read_text())
    assert written == {"frames": [{"file_path": "a.png"}, {"file_path": "c.png"}]}
