"""`gslts log` of a map in which an object moved between two versions."""

import json
from pathlib import Path

import pytest
from command import gslts
from store_maps import BOX, REJECTED, random_map

from gslts.cli.history import log
from gslts.store.causes import UpdateCause
from gslts.store.history import History
from gslts.store.map_folder import open_map, write_map_folder
from gslts.store.records import ObjectEvent, Rejection

OTHER = ((2.0, 0.0, 0.0), (2.1, 0.1, 0.2))
MOVE = "Mug moved from (0.05, 0.05, 0.10) m to (2.05, 0.05, 0.10) m"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a map of three versions."""
    write_map_folder(tmp_path / "map", random_map(5), {"dataset": "room"}, {})
    with open_map(tmp_path / "map", writable=True) as store:
        gone = ObjectEvent(kind="removal", type="Mug", boxes=(BOX, None))
        store.commit(store.read(), UpdateCause(round=0), [gone])
        store.add_rejection(REJECTED)
        came = ObjectEvent(kind="addition", type="Mug", boxes=(None, OTHER))
        store.commit(store.read(), UpdateCause(round=4), [came])
    return tmp_path


def test_a_move_is_an_event_of_the_later_version(folder: Path) -> None:
    lines = gslts("log", "map", cwd=folder).stdout.splitlines()
    assert lines[0].split()[0] == "3"
    assert lines[1].strip() == MOVE
    assert lines[4].strip() == "Mug: see version 3"
    assert sum("Mug moved" in line for line in lines) == 1
    assert MOVE in gslts("show", "map", "3", cwd=folder).stdout
    assert "Mug: see version 3" in gslts("show", "map", "2", cwd=folder).stdout


def test_one_object_is_listed(folder: Path) -> None:
    (line,) = gslts("log", "map", "--object", "mug", cwd=folder).stdout.splitlines()
    assert line.startswith("     3  ")
    assert line.endswith(MOVE)
    track = json.loads(gslts("log", "map", "--object", "Mug", "--json", cwd=folder).stdout)
    assert (track["name"], track["events"][0]["parts"]) == ("Mug", [2, 3])
    history = json.loads(gslts("log", "map", "--json", cwd=folder).stdout)
    assert history["tracks"] == [track]
    assert [event["kind"] for event in history["events"]] == ["removal", "addition"]


def test_differences_are_told_as_in_the_log(folder: Path) -> None:
    lines = gslts("diff", "map", "1", "3", cwd=folder).stdout.splitlines()
    assert lines[1:] == [f"version 3: {MOVE}"]
    lines = gslts("diff", "map", "3", "2", cwd=folder).stdout.splitlines()
    assert lines[1:] == [f"without version 3: {MOVE}"]
    lines = gslts("diff", "map", "1", "2", cwd=folder).stdout.splitlines()
    assert lines[1:] == ["version 2: Mug removed from (0.05, 0.05, 0.10) m"]


def test_an_unknown_object_is_named_with_those_that_are_known(folder: Path) -> None:
    for arguments in ([], ["--json"]):
        done = gslts("log", "map", "--object", "Vase", *arguments, cwd=folder)
        assert done.returncode == 1
        assert done.stdout == ""
        assert done.stderr == ("gslts: map: no object Vase has changed; objects that have: Mug\n")


def test_the_page_lists_the_objects(folder: Path) -> None:
    assert gslts("log", "map", "--html", "page.html", cwd=folder).returncode == 0
    page = (folder / "page.html").read_text()
    assert "<h2>Objects</h2>" in page
    assert page.count(MOVE) == 2


def test_a_commit_during_the_command_does_not_stop_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rejections_of = History.rejections

    def commit_first(self: History) -> list[Rejection]:
        with open_map(folder / "map", writable=True) as store:
            store.restore(1)
        return rejections_of(self)

    monkeypatch.setattr(History, "rejections", commit_first)
    log(folder / "map")
    assert capsys.readouterr().out.split()[0] == "3"


def test_names_of_files_do_not_control_the_terminal(folder: Path) -> None:
    done = gslts("log", "\x1b[2J\nmap\x9b", cwd=folder)
    assert done.stderr == (
        "gslts: \\x1b[2J map\\x9b: there is no such folder; gslts map makes a map\n"
    )
