"""Commands of buildings, on synthetic maps of two rooms."""

import json
import shutil
from pathlib import Path

import pytest
import surfel_flat
import surfel_room
from command import gslts
from typer.testing import CliRunner

from gslts.cli import app
from gslts.fleet.building_history import read_room_history
from gslts.store.causes import RejectedUpdateCause, UpdateCause, UpdateRecord
from gslts.store.history import History
from gslts.store.map_folder import open_map
from gslts.store.records import ObjectEvent, Rejection
from gslts_sim import write_glb

BOX = ((1.0, 1.0, 0.0), (1.2, 1.2, 0.2))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with maps, the file of a building, and the home."""
    folder = tmp_path_factory.mktemp("made")
    surfel_flat.write_building(folder)
    write_glb(surfel_flat.home(), folder / "home.glb")
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a copy of the folder; caches of commands are in it."""
    shutil.copytree(made, tmp_path / "home")
    monkeypatch.chdir(tmp_path / "home")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "home"


def run(*arguments: str) -> tuple[int, list[str], str]:
    """Run `gslts building` in this process; return exit status, lines and error."""
    done = CliRunner().invoke(app, ["building", *arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        assert isinstance(done.exception, (OSError, ValueError, RuntimeError))
        return 1, done.stdout.splitlines(), str(done.exception)
    return done.exit_code, done.stdout.splitlines(), done.stderr


def change_kitchen(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Commit an update of Anna, and a rejected one of Ben."""
    monkeypatch.setenv("GSLTS_ROBOT", "anna")
    event = ObjectEvent(kind="addition", type="Pillow", boxes=(None, BOX))
    with open_map(folder / "kitchen", writable=True) as store:
        store.commit(store.read(), UpdateCause(), [event])
        monkeypatch.setenv("GSLTS_ROBOT", "ben")
        store.add_rejection(RejectedUpdateCause(record=UpdateRecord(rejected="no view")))


@pytest.mark.smoke
def test_a_building_is_written_shown_asked_and_crossed(folder: Path) -> None:
    (folder / "building.json").unlink()
    building = "building.json"
    for arguments, rooms, doors in (
        (("add", building, "kitchen", "kitchen"), 1, 0),
        (("add", building, "hall", "hall", "--transform", "hall.txt"), 2, 0),
        (("door", building, "kitchen", "hall", "4.05", "0.7"), 2, 1),
        (("door", building, "kitchen", "hall", "4.05", "2.4", "-0.1"), 2, 2),
    ):
        done = gslts("building", *arguments, cwd=folder)
        assert done.stdout == f"{building}: {rooms} room(s), {doors} door(s)\n", done.stderr
    done = gslts("building", "query", building, "mug", cwd=folder)
    assert done.stdout.startswith("mug in hall at (6.70, 2.70, 0.15) m, 0.20 x 0.20 x 0.30 m")
    done = gslts("building", "go", building, "mug", "--from", "kitchen", "0.5", "0.5", cwd=folder)
    first, kitchen, hall = done.stdout.splitlines()
    assert first.startswith("mug in hall at (6.70, 2.70, 0.15) m")
    assert kitchen.startswith("  kitchen: ")
    assert kitchen.endswith(" m to the door between kitchen and hall at (4.05, 2.40) m")
    assert hall.startswith("  hall: ")
    metres = [float(line.split(": ")[-1].split()[0]) for line in (first, kitchen, hall)]
    assert metres[0] == pytest.approx(metres[1] + metres[2], abs=0.11)
    done = gslts("building", "go", building, "box", "--robot", "home.glb", cwd=folder)
    assert done.stdout.splitlines()[0].startswith("box in kitchen at (0.30, 2.70, 0.20) m")
    assert done.stdout.splitlines()[-1].startswith("reached the box: path of ")


def test_ages_robots_and_changes_are_shown(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    change_kitchen(folder, monkeypatch)
    status, lines, _ = run("show", "building.json")
    assert status == 0
    header, kitchen, change, hall, *doors = lines
    assert header.split() == [
        "room",
        "version",
        "Gaussians",
        "changed",
        "observed",
        "robots",
        "map",
    ]
    assert kitchen.split()[:2] == ["kitchen", "3"]
    assert " ben, anna, " in kitchen
    assert change.strip().startswith("Pillow added at (1.10, 1.10, 0.10) m: version 3, ")
    assert change.endswith(" ago, by anna")
    assert hall.split()[:2] == ["hall", "2"]
    assert doors == [
        f"door between kitchen and hall at (4.05, {y:.2f}) m" for _, y, _ in surfel_flat.DOORS
    ]
    status, lines, _ = run("show", "building.json", "--since", "0m")
    assert (status, len(lines)) == (0, 5)


def test_json_has_times_and_changes(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    change_kitchen(folder, monkeypatch)
    shutil.rmtree(folder / "hall")
    status, lines, error = run("show", "building.json", "--json")
    shown = json.loads("\n".join(lines))
    kitchen = shown["rooms"]["kitchen"]
    assert (kitchen["version"], kitchen["map"]) == (3, "kitchen")
    assert kitchen["observed_s"] >= kitchen["changed_s"]
    (change,) = kitchen["changes"]
    assert (change["name"], change["robot"], change["version"]) == ("Pillow", "anna", 3)
    assert "hall: there is no such folder" in shown["rooms"]["hall"]["error"]
    assert shown["doors"][0] == {"rooms": ["kitchen", "hall"], "position_m": [4.05, 0.7, 0.0]}
    assert (status, error) == (1, "building.json: 1 map(s) cannot be read, named above")


def test_a_map_that_cannot_be_read_is_one_line(folder: Path) -> None:
    shutil.rmtree(folder / "hall")
    done = gslts("building", "show", "building.json", cwd=folder)
    assert done.returncode == 1
    assert done.stderr == "gslts: building.json: 1 map(s) cannot be read, named above\n"
    _, kitchen, hall, *doors = done.stdout.splitlines()
    assert kitchen.split()[1] == "2"
    assert hall.startswith("hall     cannot be read: ")
    assert len(doors) == 2
    done = gslts("building", "query", "building.json", "box", "--json", cwd=folder)
    assert done.returncode == 1
    (box,) = json.loads(done.stdout)
    assert (box["room"], box["low_m"][2]) == ("kitchen", 0)
    assert done.stderr.splitlines()[0].startswith("hall: cannot be read: ")


def test_a_building_and_its_maps_lie_behind_a_url(folder: Path) -> None:
    bucket = folder.parent / "bucket"
    for room in ("kitchen", "hall"):
        app(["push", room, f"file://{bucket}/{room}"], standalone_mode=False)
    shutil.copy("building.json", bucket)
    for path in (folder / "kitchen", folder / "hall", folder / "building.json"):
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    url = f"file://{bucket}/building.json"
    status, lines, error = run("show", url)
    assert (status, error) == (0, "")
    assert [line.split()[0] for line in lines[1:3]] == ["kitchen", "hall"]
    status, lines, _ = run("query", url, "mug")
    assert lines[0].startswith("mug in hall at (6.70, 2.70, 0.15) m")
    status, lines, _ = run("go", url, "mug", "--from", "kitchen", "0.5", "0.5")
    assert (status, len(lines)) == (0, 3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("show", "none.json"), "No such file or directory: 'none.json'"),
        (
            ("show", "file:///none.json"),
            "file:///none.json: expected a file in a bucket or a folder",
        ),
        (("show", "file:///none/a.json"), "file:///none: there is no such folder"),
        (("show", "building.json", "--since", "soon"), "--since: expected a duration such as 90m"),
        (("query", "building.json", " "), "WORDS: expected the name of an object, got nothing"),
        (("add", "building.json", "hall", "hall"), "there is a room hall already; edit the file"),
        (("add", "building.json", "attic", "attic"), "attic: there is no such folder"),
        (("add", "building.json", "attic", "../attic"), "../attic is outside of the folder"),
        (("add", "building.json", "a/b", "hall"), "building.json: rooms.a/b"),
        (("add", "building.json", "attic", "hall", "--transform", "wrong.txt"), "got 3"),
        (
            ("add", "building.json", "attic", "hall", "--transform", "flat.txt"),
            "flat.txt: building",
        ),
        (("add", "building.json", "a/b", "hall", "--transform", "hall.txt"), "json: rooms.a/b"),
        (("add", "s3://maps/building.json", "attic", "hall"), "edit a file on this disk"),
        (("add", "building.json", "attic", "file:///none"), "file:///none: there is no such"),
        (("door", "building.json", "hall", "attic", "1", "2"), "there is no room attic"),
        (("door", "building.json", "hall", "kitchen", "1", "-2"), "m from the free floor of hall"),
        (("door", "building.json", "hall", "kitchen", "nan", "-2"), "finite number"),
        (("go", "building.json", "mug"), "give either a --robot, or a start with --from ROOM X Y"),
        (("go", "building.json", "mug", "--from", "attic", "1", "-2"), "there is no room attic"),
        (("go", "building.json", "sofa", "--from", "hall", "6", "1"), "the maps have no sofa"),
        (("go", "building.json", "mug", "--from", "hall", "-9", "1"), "there is no route from"),
        (("go", "building.json", "mug", "--robot", "nowhere.glb"), "nowhere.glb"),
    ],
)
def test_errors_are_one_line(folder: Path, arguments: tuple[str, ...], message: str) -> None:
    (folder / "wrong.txt").write_text("1 0 0")
    (folder / "flat.txt").write_text(" ".join(["1"] * 16))
    before = (folder / "building.json").read_bytes()
    status, lines, error = run(*arguments)
    assert (status, lines) == (1, [])
    assert message in error
    assert len(error.splitlines()) == 1
    assert (folder / "building.json").read_bytes() == before


def test_rooms_without_words_are_named(folder: Path) -> None:
    surfel_flat.write_map(surfel_room.surfel_map(), folder / "cellar", words=False)
    run("add", "building.json", "cellar", "cellar")
    status, lines, error = run("query", "building.json", "sofa")
    assert (status, lines) == (0, ["sofa: not found"])
    assert error == "cellar: its map has no semantic features; it was not asked\n"


def test_a_commit_during_the_command_does_not_stop_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rejections_of = History.rejections

    def commit_first(self: History) -> list[Rejection]:
        monkeypatch.undo()
        change_kitchen(folder, monkeypatch)
        return rejections_of(self)

    monkeypatch.setattr(History, "rejections", commit_first)
    found = read_room_history(folder / "kitchen", 0.0)
    assert (found.version, found.changes) == (2, ())
