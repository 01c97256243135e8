"""Commands of shared maps, and other commands with the URL of one."""

from pathlib import Path

import pytest
from command import gslts
from synthetic_rooms import change_room, write_rooms

from gslts.store.map_folder import open_map


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with a map; caches of commands are in it."""
    write_rooms(tmp_path / "map")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path


def test_two_robots_exchange_versions(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    url = f"file://{folder}/bucket"
    assert gslts("push", "map", url, cwd=folder).stdout == "map is version 1: 0 pulled, 1 pushed\n"
    assert gslts("clone", url, "other", cwd=folder).stdout == "other is version 1: 300 Gaussians\n"
    monkeypatch.setenv("GSLTS_ROBOT", "anna")
    change_room(folder / "map", 0, 1)
    assert gslts("push", "map", cwd=folder).stdout == "map is version 2: 0 pulled, 1 pushed\n"
    monkeypatch.setenv("GSLTS_ROBOT", "ben")
    change_room(folder / "other", 0, 2)
    change_room(folder / "other", 1, 3)
    done = gslts("push", "other", cwd=folder)
    assert done.stdout.splitlines() == [
        "given up: version 2 of anna changed the same region; observe it again",
        "other is version 3: 1 pulled, 1 pushed",
    ]
    assert gslts("pull", "map", cwd=folder).stdout == "map is version 3: 1 pulled, 0 pushed\n"
    log = gslts("log", "map", cwd=folder).stdout
    assert log.index("  ben  ") < log.index("  anna  ")
    rejected = gslts("log", "other", cwd=folder).stdout
    assert "  ben  update rejected: version 2 of anna changed the same region" in rejected


def test_commands_take_a_url(folder: Path) -> None:
    url = f"file://{folder}/bucket"
    gslts("push", "map", url, cwd=folder)
    assert len(gslts("log", url, cwd=folder).stdout.splitlines()) == 1
    change_room(folder / "map", 0)
    gslts("push", "map", cwd=folder)
    assert len(gslts("log", url, cwd=folder).stdout.splitlines()) == 3
    assert gslts("restore", url, "1", cwd=folder).stdout.endswith("version 3 is pushed\n")
    gslts("pull", "map", cwd=folder)
    with open_map(folder / "map") as store:
        assert store.version().kind == "restore"
    export = gslts("export", f"{url}@2", "map.ply", cwd=folder)
    assert export.stdout.startswith("wrote map.ply")


def test_a_command_with_a_url_fails_with_its_own_error(folder: Path) -> None:
    url = f"file://{folder}/bucket"
    gslts("push", "map", url, cwd=folder)
    done = gslts("restore", url, "7", cwd=folder)
    assert (done.returncode, done.stdout) == (1, "")
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.endswith("there is no version 7\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("pull", "map"), "map: it was never shared: gslts push map URL shares it"),
        (
            ("clone", "nowhere", "new"),
            "nowhere: not a URL; expected s3://, gs://, az:// or file://",
        ),
        (("clone", "file://nowhere", "new"), "file://nowhere: a file URL has a whole path"),
        (("clone", "file:///nowhere", "new"), "file:///nowhere: there is no such folder"),
        (("clone", "file:///nowhere", "map"), "map exists already"),
        (("push", "nowhere", "file:///nowhere"), "nowhere: there is no such folder"),
        (("log", "file:///nowhere"), "file:///nowhere: there is no such folder"),
    ],
)
def test_errors_are_one_line(folder: Path, arguments: tuple[str, ...], message: str) -> None:
    done = gslts(*arguments, cwd=folder)
    assert (done.returncode, done.stdout) == (1, "")
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert sorted(path.name for path in folder.iterdir()) == ["map"]


def test_a_wrong_name_of_a_robot_is_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GSLTS_ROBOT", "two words")
    done = gslts("restore", "map", "1", cwd=folder)
    assert done.stderr == (
        "gslts: GSLTS_ROBOT: a name has 1 to 64 letters, digits or characters of _.@-, "
        "got 'two words'\n"
    )
    with open_map(folder / "map") as store:
        assert len(store.versions()) == 1
