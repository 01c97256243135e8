"""Cache of folders: keys hold everything that decides the content, and folders are complete."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from gslts.mapping.config import PRESETS
from gslts_bench import cache
from gslts_bench.cache import (
    MADE_OF,
    cached_folder,
    code_digest,
    digest,
    native_digest,
    source_files,
)
from gslts_bench.detection.cases import Counts
from gslts_bench.detection.run import DetectUnit
from gslts_bench.homes import BenchHome, HomeSetup
from gslts_bench.real.boxes import Kind, MarkedObject, MarkedRoom
from gslts_bench.real.run import VisitUnit
from gslts_bench.real.updates import UpdateUnit
from gslts_bench.real.visits import RealRoom
from gslts_bench.relocalization.run import RelocalizeUnit
from gslts_bench.runner import BenchUnit

HOME = BenchHome("kitchen", 3, HomeSetup(), Path("work"))
UNIT = DetectUnit(HOME, Counts(8, 1, 1, 5, 3))


def with_setup(**changes: object) -> BenchHome:
    return replace(HOME, setup=replace(HOME.setup, **changes))


def with_code(name: str, part: str = "python") -> BenchHome:
    code = HOME.setup.code
    assert part in code[name]
    return with_setup(code={**code, name: {**code[name], part: "another"}})


OTHER_RECORDINGS = {
    "seed": replace(HOME, seed=4),
    "room type": replace(HOME, room_type="bedroom"),
    "frames": with_setup(frames=100),
    "size": with_setup(width=320),
    "noise": with_setup(noise="none"),
    "simulator": with_code("sim"),
    "native simulator": with_code("sim", "native"),
}
OTHER_MAPS = {
    **OTHER_RECORDINGS,
    "preset": with_setup(mapping=PRESETS["best"]),
    "setting": with_setup(mapping=PRESETS["fast"].model_copy(update={"seed": 1})),
    "mapping": with_code("map"),
    "native": with_code("map", "native"),
}
RELOCALIZE_UNIT = RelocalizeUnit(HOME, 60)
OTHER_RELOCALIZATIONS = {
    **{name: replace(RELOCALIZE_UNIT, bench=home) for name, home in OTHER_MAPS.items()},
    "views": replace(RELOCALIZE_UNIT, views=30),
}
OTHER_RESULTS = {
    **{name: replace(UNIT, bench=home) for name, home in OTHER_MAPS.items()},
    "counts": replace(UNIT, counts=Counts(8, 1, 1, 6, 3)),
    "shifted": replace(UNIT, counts=Counts(8, 1, 1, 5, 4)),
}


@pytest.mark.parametrize("what", OTHER_RECORDINGS)
def test_settings_of_a_recording_decide_its_key(what: str) -> None:
    assert digest(OTHER_RECORDINGS[what].recorded_of) != digest(HOME.recorded_of)


@pytest.mark.parametrize("what", OTHER_MAPS)
def test_settings_of_a_map_decide_its_key(what: str) -> None:
    assert digest(OTHER_MAPS[what].mapped_of) != digest(HOME.mapped_of)


@pytest.mark.parametrize("what", OTHER_RESULTS)
def test_settings_of_detection_decide_the_file_of_results(what: str) -> None:
    assert OTHER_RESULTS[what].results != UNIT.results


@pytest.mark.parametrize("what", OTHER_RELOCALIZATIONS)
def test_settings_of_relocalization_decide_the_file_of_results(what: str) -> None:
    assert OTHER_RELOCALIZATIONS[what].results != RELOCALIZE_UNIT.results


@pytest.mark.parametrize("unit", [UNIT, RELOCALIZE_UNIT])
def test_code_decides_the_file_of_results(unit: BenchUnit) -> None:
    other = replace(unit)
    vars(other)["code"] = {**unit.code, "native": "another"}
    assert other.results != unit.results
    other = replace(UNIT)
    vars(other)["cases_of"] = {**UNIT.cases_of, "code": "another"}
    assert other.results != UNIT.results


@pytest.mark.parametrize("unit", [VisitUnit, UpdateUnit])
def test_boxes_and_later_visits_decide_the_file_of_results(
    unit: type[BenchUnit], tmp_path: Path
) -> None:
    def results(kind: Kind = "new", image: str = "image", path: str = "scene2/a.jpg") -> Path:
        mug = MarkedObject(kind=kind, name="mug", box_px=[0, 0, 9, 9])
        marked = MarkedRoom(
            room="Office", reference="scene1", visits={"scene2": {"a.jpg": [mug]}, "scene3": {}}
        )
        for name in ("scene1/a.jpg", "scene2/a.jpg", "scene3/a.jpg"):
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_text(image if name == path else "image")
        room = RealRoom(tmp_path, marked, PRESETS["fast"], Path("work"))
        maps.add(digest(room.mapped_of))
        found = unit(room).results
        assert found is not None
        return found

    maps: set[str] = set()
    assert results() == results()
    others = (results("ignore"), results("new", "b"), results("new", "b", "scene3/a.jpg"))
    assert len({results(), *others}) == 4
    assert len(maps) == 1, "the map stays"


def test_settings_without_effect_do_not_change_keys() -> None:
    threads = PRESETS["fast"].model_copy(update={"threads": 7})
    assert with_setup(mapping=threads).mapped_of == HOME.mapped_of
    assert with_setup(mapping=PRESETS["best"]).recorded_of == HOME.recorded_of
    assert with_code("map").recorded_of == HOME.recorded_of
    assert replace(UNIT, trade=True).results == UNIT.results, "other detectors, other lines"
    more = replace(RELOCALIZE_UNIT, ablation=True, trade=True)
    assert more.results == RELOCALIZE_UNIT.results


def test_digests_do_not_depend_on_the_order_of_keys() -> None:
    assert digest({"a": 1, "b": [2]}) == digest({"b": [2], "a": 1})
    assert digest({"a": 1, "b": [2]}) != digest({"a": 1, "b": ["2"]})


def test_code_is_that_of_a_module_and_of_all_that_it_imports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cache, "ROOT", tmp_path)
    sources = {
        "gslts_bench/run.py": "import numpy\nfrom gslts.change.detector import Detector",
        "gslts/__init__.py": "from gslts.keeper.keeper import Keeper",
        "gslts/change/__init__.py": "",
        "gslts/change/detector.py": "def f():\n    from gslts.core import camera",
        "gslts/core/__init__.py": "",
        "gslts/core/camera.py": "import gslts.io.files",
        "gslts/io/files.py": "",
        "gslts/keeper/keeper.py": "",
        "gslts/change/overlay.py": "",
    }
    for name, source in sources.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(source)
    not_imported = {"gslts/__init__.py", "gslts/keeper/keeper.py", "gslts/change/overlay.py"}
    found = {path.relative_to(tmp_path).as_posix() for path in source_files("gslts_bench.run")}
    assert found == {*sources} - not_imported

    fresh = code_digest.__wrapped__  # Without its cache.
    digests = {fresh("gslts_bench.run")}
    for name, source in sources.items():
        (tmp_path / name).write_text(f"{source}\nA = 1")
        digests.add(fresh("gslts_bench.run"))
    assert len(digests) == 1 + len(found)
    without = source_files("gslts_bench.run", without=("gslts.core",))
    assert {path.name for path in without} == {"run.py", "detector.py", "__init__.py"}
    assert len(source_files("gslts.change")) == 6, "a package stands for its modules"
    with pytest.raises(ValueError, match=r"no module 'gslts\.none'"):
        fresh("gslts.core", "gslts.none")
    assert len(native_digest()) == 16


@pytest.mark.parametrize(
    ("module", "parts"),
    [
        ("gslts_bench.homes", {"gslts_sim/capture.py", "gslts/mapping/engine.py"}),
        ("gslts_bench.detection.run", {"gslts/change/detector.py", "gslts_sim/raycast.py"}),
        ("gslts_bench.relocalization.run", {"gslts/localization/relocalizer.py"}),
    ],
)
def test_the_code_of_a_benchmark_holds_what_it_measures(module: str, parts: set[str]) -> None:
    found = {path.relative_to(cache.ROOT).as_posix() for path in source_files(module)}
    assert parts <= found
    assert "gslts_bench/runner.py" not in found


def test_a_folder_is_made_once(tmp_path: Path) -> None:
    calls = []

    def make(folder: Path) -> None:
        calls.append(folder)
        folder.mkdir()
        (folder / "content").write_text("whole")

    first = cached_folder(tmp_path / "maps" / "kitchen_3", {"seed": 3}, make)
    assert cached_folder(tmp_path / "maps" / "kitchen_3", {"seed": 3}, make) == first
    assert len(calls) == 1
    assert calls[0] != first
    assert (first / "content").read_text() == "whole"
    assert json.loads((first / MADE_OF).read_text()) == {"seed": 3}
    assert cached_folder(tmp_path / "maps" / "kitchen_3", {"seed": 4}, make) != first


def test_an_unfinished_folder_is_made_again(tmp_path: Path) -> None:
    def stopped(folder: Path) -> None:
        folder.mkdir()
        (folder / "half").touch()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cached_folder(tmp_path / "a", 1, stopped)
    assert not list(tmp_path.glob("a*"))
    whole = cached_folder(tmp_path / "a", 1, Path.mkdir)
    assert [path.name for path in whole.iterdir()] == [MADE_OF]


def test_two_at_a_time_make_it_once(tmp_path: Path) -> None:
    calls = []

    def make(folder: Path) -> None:
        calls.append(folder)
        folder.mkdir()
        barrier.submit(lambda: None).result()

    with ThreadPoolExecutor(4) as pool, ThreadPoolExecutor(1) as barrier:
        folders = list(pool.map(lambda _: cached_folder(tmp_path / "a", 1, make), range(4)))
    assert len(set(folders)) == len(calls) == 1
