"""The command `gslts update`, as a user meets it."""

import shutil
from dataclasses import replace
from pathlib import Path

import change_room
import numpy as np
import pytest
import update_room
from command import gslts
from PIL import Image
from update_room import viewpoints_of_the_change

from gslts.store.camera_files import cameras_of_map
from gslts.store.causes import UpdateCause
from gslts.store.map_folder import open_map, read_map
from gslts_sim.capture import capture


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a map, a recording after a removal, and one without a change."""
    folder = tmp_path_factory.mktemp("update")
    change_room.write_room_map(folder / "map")
    for name, home in (
        ("visit", update_room.changed_home("removal")),
        ("same", change_room.home()),
    ):
        capture(update_room.robot_in(home), viewpoints_of_the_change(), folder / name)
    return folder


@pytest.fixture(scope="module")
def updated(workplace: Path) -> list[str]:
    """Return the output of the first update."""
    given = ("--iterations", "40", "--threads", "1")
    done = gslts("update", "map", "--frames", "visit", *given, cwd=workplace)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.smoke
def test_recorded_frames_update_a_map(workplace: Path, updated: list[str]) -> None:
    assert updated[0].startswith("removal at (2.")
    assert updated[-1].startswith("map is version 2 now: ")
    old, new = read_map(workplace / "map@1"), read_map(workplace / "map")
    with open_map(workplace / "map") as store:
        version = store.version()
        (event,) = store.events()
    assert isinstance(version.cause, UpdateCause)
    record = version.cause.record
    assert record.rejected is None
    assert record.kinds == ("removal",)
    assert new.size == old.size - record.removed + record.added
    assert record.psnr_before_db is not None
    assert record.psnr_after_db is not None
    assert record.psnr_after_db > record.psnr_before_db
    assert (event.version, event.kind) == (2, "removal")
    assert update_room.opaque_in(new, update_room.REMOVED, 0.04) == 0
    cameras = cameras_of_map(workplace / "map")
    new_views = len(cameras) - len(cameras_of_map(workplace / "map@1"))
    views = record.training_views + record.validation_views
    assert 0 < new_views <= views, "only new viewpoints"
    with Image.open(workplace / "map" / "updates" / "00002.jpg") as image:
        assert image.size == (3 * 160, 3 * 120)


@pytest.mark.smoke
def test_the_history_is_printed(workplace: Path, updated: list[str]) -> None:
    assert updated
    printed = gslts("log", "map", cwd=workplace).stdout.splitlines()
    assert printed[0].split()[0] == "2"
    assert "object removed from (2." in printed[1]
    assert printed[-1].split()[0] == "1"
    track = gslts("log", "map", "--object", "Object", cwd=workplace).stdout
    assert track.split()[0] == "2"
    assert "object removed from (2." in track
    assert len(track.splitlines()) == 1
    shown = gslts("show", "map", "2", cwd=workplace).stdout
    assert '"removal"' in shown
    assert "updates/00002.jpg" in shown
    apart = gslts("diff", "map", "1", "2", "--out", "apart.png", cwd=workplace).stdout
    assert "Gaussians removed" in apart
    with Image.open(workplace / "apart.png") as image:
        assert image.size[0] == 3 * 160
    assert gslts("verify", "map", cwd=workplace).stdout == "2 versions are intact\n"
    assert gslts("gc", "map", cwd=workplace).stdout == "0 bytes freed\n"


def test_an_old_version_is_restored(workplace: Path, updated: list[str]) -> None:
    assert updated
    done = gslts("restore", "map", "1", cwd=workplace)
    assert done.returncode == 0, done.stderr
    with open_map(workplace / "map") as store:
        number = store.version().number
    old, new = read_map(workplace / "map@1"), read_map(workplace / f"map@{number}")
    np.testing.assert_array_equal(old.means, new.means)
    assert len(read_map(workplace / "map@2").means) != len(old.means)
    printed = gslts("log", "map", cwd=workplace).stdout.splitlines()
    assert any(line.endswith("m, undone since") for line in printed)
    failed = gslts("log", "map", "--object", "Object", cwd=workplace)
    assert failed.returncode == 1
    assert failed.stderr == ("gslts: map: no object Object has changed; objects that have: none\n")
    assert "removed from" not in gslts("diff", "map", "1", str(number), cwd=workplace).stdout
    back = gslts("diff", "map", "2", str(number), cwd=workplace).stdout.splitlines()
    assert back[1].startswith("without version 2: object removed from (2.")


def test_an_image_that_cannot_be_written_is_reported(
    workplace: Path, updated: list[str], tmp_path: Path
) -> None:
    assert updated
    shutil.copytree(workplace / "map", tmp_path / "map")
    shutil.rmtree(tmp_path / "map" / "updates")
    (tmp_path / "map" / "updates").write_bytes(b"not a folder")
    with open_map(tmp_path / "map", writable=True) as store:
        number = store.restore(1).number + 1
    given = ("--iterations", "40", "--threads", "1")
    done = gslts("update", "map", "--frames", workplace / "visit", *given, cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(
        f"gslts: map is version {number} now, but without an image: "
    )
    assert "map/updates" in done.stderr
    with open_map(tmp_path / "map") as store:
        assert store.version().number == number


def test_without_a_change_the_map_is_unchanged(workplace: Path) -> None:
    with open_map(workplace / "map") as store:
        before = store.versions()
    done = gslts("update", "map", "--frames", "same", cwd=workplace)
    assert (done.returncode, done.stdout) == (0, "map is unchanged: no change was detected\n")
    with open_map(workplace / "map") as store:
        assert store.versions() == before
        assert store.rejections() == []


def test_a_recording_of_few_frames_needs_fewer_of_them(tmp_path: Path) -> None:
    change_room.write_room_map(tmp_path / "map")
    viewpoints = viewpoints_of_the_change()
    few = [viewpoints[0], viewpoints[6]]  # Two views of the change.
    capture(update_room.robot_in(update_room.changed_home("removal")), few, tmp_path / "few")
    given = ("--frames", "few", "--iterations", "40", "--threads", "1")
    done = gslts("update", "map", *given, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    message = "expected at least 3, as so many must show a change, got 2; see --needed"
    assert message in done.stderr.splitlines()[-1]
    done = gslts("update", "map", *given, "--needed", "1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "map is version 2 now" in done.stdout


def test_frames_of_another_home_are_rejected(workplace: Path) -> None:
    walls = change_room.tiled("Wall|1", (0, 0, -0.2), (5, 4, 2.6), 10, 40, inward=True)
    floor = change_room.tiled("Floor|1", (0, 0, -0.1), (5, 4, 0), 11, 90)
    elsewhere = replace(change_room.home(), objects=(walls, floor))
    capture(
        update_room.robot_in(elsewhere), viewpoints_of_the_change()[:3], workplace / "elsewhere"
    )
    done = gslts("update", "map", "--frames", "elsewhere", cwd=workplace)
    assert done.returncode == 1
    line = done.stderr.splitlines()[-1]
    assert line.startswith("gslts: map is unchanged, the update was rejected: none of 3 frames can")
    printed = gslts("log", "map", cwd=workplace).stdout
    assert "update rejected: none of 3 frames can be compared with the map" in printed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("update", "map"), "give either --robot or --frames"),
        (("update", "map", "--frames", "visit", "--robot", "x"), "give either --robot or --frames"),
        (("update", "nowhere", "--frames", "visit"), "nowhere"),
        (("update", "map", "--frames", "nowhere"), "nowhere"),
        (("update", "map", "--robot", "nowhere.json"), "nowhere.json"),
        (("update", "visit", "--frames", "visit"), "visit: it has no manifest.json"),
        (("log", "nowhere"), "nowhere"),
        (("show", "map", "99"), "map: there is no version 99"),
        (("diff", "map", "1", "99"), "map: there is no version 99"),
        (("restore", "map", "99"), "map: there is no version 99"),
        (("export", "map@99", "x.ply"), "map: there is no version 99"),
    ],
)
def test_bad_input_is_named_in_one_line(
    workplace: Path, arguments: tuple[str, ...], message: str
) -> None:
    done = gslts(*arguments, cwd=workplace)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert message in done.stderr.splitlines()[-1]
    assert not (workplace / "x.ply").exists()
