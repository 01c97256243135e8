"""What was made before is found again by everything that made it, and is whole."""

import ast
import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from gslts.mapping.config import PRESETS
from gslts_bench import made as bench_made
from gslts_bench.detection.cases import Counts
from gslts_bench.detection.run import DETECT_CODE, DetectUnit
from gslts_bench.homes import MAP_CODE, SIM_CODE, BenchHome, HomeSetup
from gslts_bench.made import MADE_OF, code_of, digest, made, native_code
from gslts_bench.relocalization.fold import FOLD_CODE
from gslts_bench.relocalization.run import RELOCALIZE_CODE, RelocalizeUnit

HOME = BenchHome("kitchen", 3, HomeSetup(), Path("work"))
UNIT = DetectUnit(HOME, Counts(8, 1, 1, 5))


def with_setup(**changes: object) -> BenchHome:
    return replace(HOME, setup=replace(HOME.setup, **changes))


def with_code(name: str) -> BenchHome:
    code = {**HOME.setup.code, name: {**HOME.setup.code[name], "python": "another"}}
    return with_setup(code=code)


OTHER_RECORDINGS = {
    "seed": replace(HOME, seed=4),
    "room type": replace(HOME, room_type="bedroom"),
    "frames": with_setup(frames=100),
    "size": with_setup(width=320),
    "noise": with_setup(noise="none"),
    "simulator": with_code("sim"),
}
OTHER_MAPS = {
    **OTHER_RECORDINGS,
    "preset": with_setup(mapping=PRESETS["best"]),
    "setting": with_setup(mapping=PRESETS["fast"].model_copy(update={"seed": 1})),
    "mapping": with_code("map"),
    "native": with_setup(code={**HOME.setup.code, "map": {"native": "another"}}),
}
RELOCALIZE_UNIT = RelocalizeUnit(HOME, 60)
OTHER_RELOCALIZATIONS = {
    **{name: replace(RELOCALIZE_UNIT, bench=home) for name, home in OTHER_MAPS.items()},
    "views": replace(RELOCALIZE_UNIT, views=30),
    "makers of frames": replace(
        RELOCALIZE_UNIT, code={**RELOCALIZE_UNIT.code, "frames": "another"}
    ),
    "relocalizer": replace(RELOCALIZE_UNIT, code={**RELOCALIZE_UNIT.code, "finding": "another"}),
}
OTHER_RESULTS = {
    **{name: replace(UNIT, bench=home) for name, home in OTHER_MAPS.items()},
    "counts": replace(UNIT, counts=Counts(8, 1, 1, 6)),
    "makers of cases": replace(UNIT, code={**UNIT.code, "cases": "another"}),
    "detector": replace(UNIT, code={**UNIT.code, "detect": "another"}),
}


@pytest.mark.parametrize("what", OTHER_RECORDINGS)
def test_what_made_a_recording_decides_its_key(what: str) -> None:
    assert digest(OTHER_RECORDINGS[what].recorded_of) != digest(HOME.recorded_of)


@pytest.mark.parametrize("what", OTHER_MAPS)
def test_what_made_a_map_decides_its_key(what: str) -> None:
    assert digest(OTHER_MAPS[what].mapped_of) != digest(HOME.mapped_of)


@pytest.mark.parametrize("what", OTHER_RESULTS)
def test_what_decides_results_decides_their_file(what: str) -> None:
    assert OTHER_RESULTS[what].results != UNIT.results


@pytest.mark.parametrize("what", OTHER_RELOCALIZATIONS)
def test_what_decides_where_frames_are_found_decides_their_file(what: str) -> None:
    assert OTHER_RELOCALIZATIONS[what].results != RELOCALIZE_UNIT.results


def test_what_decides_nothing_does_not_count() -> None:
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


def test_code_is_that_of_files_and_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_made, "PACKAGE", tmp_path)
    fresh = code_of.__wrapped__  # Without what it remembers.
    (tmp_path / "sim" / "deep").mkdir(parents=True)
    for name in ("camera.py", "sim/a.py", "sim/deep/b.py", "other.py"):
        (tmp_path / name).write_text("1")
    first = fresh("sim", "camera")
    (tmp_path / "other.py").write_text("2")
    assert fresh("sim", "camera") == first
    seen = {first}
    for name in ("camera.py", "sim/a.py", "sim/deep/b.py"):
        (tmp_path / name).write_text("2")
        seen.add(fresh("sim", "camera"))
    (tmp_path / "sim" / "deep" / "b.py").rename(tmp_path / "sim" / "c.py")
    seen.add(fresh("sim", "camera"))
    assert len(seen) == 5
    with pytest.raises(ValueError, match="no module 'none'"):
        fresh("none")
    assert len(native_code()) == 16


@pytest.mark.parametrize(
    ("used", "known", "harmless"),
    [
        # Of the report; of relocalization only landmarks count, which stand there; too little
        # memory makes no other map but none.
        (
            ("mapping", "map_folder"),
            MAP_CODE,
            {"lpips", "pictures", "html_page", "relocalize", "memory"},
        ),
        # Of the overlay; of the robot that looks around; axes of OpenGL for files of cameras.
        (("change", "camera_files", "map_folder"), DETECT_CODE, {"pictures", "robot", "datasets"}),
        (("sim",), SIM_CODE, {"datasets"}),  # Axes of OpenGL for recordings.
        (("relocalize", "map_folder"), RELOCALIZE_CODE, {"pictures", "robot"}),
        (
            ("relocalize", "mapping", "camera_files"),
            FOLD_CODE,
            {"lpips", "pictures", "html_page", "robot", "memory"},
        ),
    ],
)
def test_all_code_that_is_used_counts(
    used: tuple[str, ...], known: tuple[str, ...], harmless: set[str]
) -> None:
    """Whoever lets one of them import more must let that decide the keys, too."""
    found, left = set(), {*used}
    while left:
        name = left.pop()
        found.add(name)
        left |= imported_by(name) - found - harmless
    assert found <= {*known}


def imported_by(name: str) -> set[str]:
    """Parts of gslts that a module or the modules of a package import, at whatever place."""
    file = bench_made.PACKAGE / f"{name}.py"
    files = [file] if file.is_file() else (bench_made.PACKAGE / name).rglob("*.py")
    names = set()
    for path in files:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module is not None:
                names.add(node.module)
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
    own = {tuple(name.split(".")) for name in names if name.startswith("gslts.")}
    return {name[1] for name in own} - {"_core"}


def test_a_folder_is_made_once(tmp_path: Path) -> None:
    calls = []

    def make(folder: Path) -> None:
        calls.append(folder)
        folder.mkdir()
        (folder / "content").write_text("whole")

    first = made(tmp_path / "maps" / "kitchen_3", {"seed": 3}, make)
    assert made(tmp_path / "maps" / "kitchen_3", {"seed": 3}, make) == first
    assert len(calls) == 1
    assert calls[0] != first
    assert (first / "content").read_text() == "whole"
    assert json.loads((first / MADE_OF).read_text()) == {"seed": 3}
    assert made(tmp_path / "maps" / "kitchen_3", {"seed": 4}, make) != first


def test_what_was_half_made_does_not_count(tmp_path: Path) -> None:
    def stopped(folder: Path) -> None:
        folder.mkdir()
        (folder / "half").touch()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        made(tmp_path / "a", 1, stopped)
    assert not list(tmp_path.glob("a*"))
    whole = made(tmp_path / "a", 1, Path.mkdir)
    assert [one.name for one in whole.iterdir()] == [MADE_OF]


def test_two_at_a_time_make_it_once(tmp_path: Path) -> None:
    calls = []

    def make(folder: Path) -> None:
        calls.append(folder)
        folder.mkdir()
        barrier.submit(lambda: None).result()

    with ThreadPoolExecutor(4) as pool, ThreadPoolExecutor(1) as barrier:
        folders = list(pool.map(lambda _: made(tmp_path / "a", 1, make), range(4)))
    assert len(set(folders)) == len(calls) == 1
