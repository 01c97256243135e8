"""Foreign homes of the benchmarks: names, keys, tasks and errors."""

from pathlib import Path

import numpy as np
import pytest
from gltf_files import flat

from gslts_bench.cache import digest
from gslts_bench.detection.visits import move_light
from gslts_bench.homes import BenchHome, HomeSetup, foreign_homes_of
from gslts_bench.navigation.episodes import CATEGORIES, categories_of
from gslts_bench.relocalization.frames import other_homes
from gslts_bench.tables import result_markdown

SETUP = HomeSetup(frames=16, width=160, height=120, code={"sim": 0, "map": 0})


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with flat.glb."""
    flat().write(tmp_path / "flat.glb")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def homes(*names: str, seeds: range = range(1)) -> list[BenchHome]:
    return foreign_homes_of([Path(name) for name in names], seeds, SETUP, Path("work"))


def test_each_seed_of_tasks_is_a_home_with_the_name_of_its_file(folder: Path) -> None:
    assert folder.is_dir()
    found = homes("flat.glb", seeds=range(4_999, 5_001))  # No split: the home is the same.
    assert [home.name for home in found] == ["flat.glb_4999", "flat.glb_5000"]
    assert len({digest(home.recorded_of) for home in found}) == 2


def test_content_and_name_decide_the_key_and_the_folder_does_not(folder: Path) -> None:
    (first,) = homes("flat.glb")
    (folder / "other").mkdir()
    (folder / "flat.glb").rename(folder / "other" / "flat.glb")
    (moved,) = homes("other/flat.glb")
    assert moved.mapped_of == first.mapped_of
    file = flat()
    file.tree["asset"]["generator"] = "another"
    file.write(folder / "flat.glb")
    (changed,) = homes("flat.glb")
    assert digest(changed.mapped_of) != digest(first.mapped_of)
    assert changed.name == first.name


def test_a_file_that_changes_during_a_run_is_rejected(folder: Path) -> None:
    (home,) = homes("flat.glb")
    file = flat()
    file.tree["asset"]["generator"] = "another"
    file.write(folder / "flat.glb")
    with pytest.raises(ValueError, match="its SHA-256 is another one"):
        home.load()


def test_tasks_change_objects_of_the_file(folder: Path) -> None:
    assert folder.is_dir()
    (home,) = homes("flat.glb")
    tasks = home.tasks(4)
    assert {task.change.object_type for task in tasks} == {"Cup"}
    state = home.default_state()
    assert {obj.id for obj in state.home.objects} == {obj.id for obj in home.load().objects}
    assert categories_of(home.room_type, state.home) == ["Cup"]
    assert categories_of("kitchen", state.home) == CATEGORIES["kitchen"]


def test_visits_of_a_home_without_lamps_move_the_light_of_a_room(folder: Path) -> None:
    assert folder.is_dir()
    (bench,) = homes("flat.glb")
    home = bench.load()
    moved = move_light(home, (0.3, -0.4))
    shifts = [new.center - old.center for old, new in zip(home.lights, moved.lights, strict=True)]
    np.testing.assert_allclose(shifts, [[0.3, -0.4, 0], [0, 0, 0]], atol=1e-9)


def test_another_home_than_a_foreign_one_is_one_of_ours(folder: Path) -> None:
    assert folder.is_dir()
    (home,) = homes("flat.glb")
    others = other_homes(home)
    assert [other.file for other in others] == [None, None]
    assert len({other.name for other in others}) == 2


def test_homes_without_tasks_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file = flat()
    for node in file.tree["nodes"]:
        if node.get("name", "").startswith("Cup"):
            node["extras"] = {"movable": 0}
    file.write(tmp_path / "flat.glb")
    (home,) = homes("flat.glb")
    with pytest.raises(ValueError, match=r"flat\.glb_0: there is no task: nothing can be changed"):
        home.tasks(3)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["none.glb"], r"none\.glb: there is no such file"),
        (["text.glb"], r"text\.glb: "),
        (["flat.obj"], r"flat\.obj: tasks need a \.glb file"),
        (["flat.glb", "./flat.glb"], "files of different names"),
    ],
)
def test_bad_files_are_rejected(folder: Path, names: list[str], message: str) -> None:
    (folder / "text.glb").write_text("text")
    with pytest.raises((ValueError, OSError), match=message):
        homes(*names)


def test_results_say_that_the_home_is_foreign() -> None:
    machine = {"cpu": "CPU", "cores": 2}
    run = {"machine": machine, "commit": "0" * 40, "date": "2026-01-01", "command": "gslts"}
    text = result_markdown({**run, "seeds": [0, 2], "foreign": ["flat.glb"], "tables": []})
    assert "Foreign home `flat.glb`, not of a split of ours; tasks with seeds 0 to 1." in text
