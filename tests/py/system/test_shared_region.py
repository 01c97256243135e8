"""Two robots change one region of a shared map."""

import shutil
from dataclasses import replace
from pathlib import Path

import change_room
import pytest
import update_room
from shared import made_once
from store_maps import assert_same

import gslts
from gslts.fleet.exchange import pull_map, push_map
from gslts.store.causes import UpdateCause
from gslts.store.map_folder import open_map, read_map
from gslts_sim.controller import Controller
from gslts_sim.home import Home


def updated(name: str, home: Home, start: int = 0, noise: str = "none") -> Path:
    """Return a clone of the map of the room, updated by a robot in a home; made once a run.

    Args:
        name: Of the robot.
        home: To look at.
        start: Row of the viewpoint from which the robot sees the change first.
        noise: Of its sensor.
    """

    def make(folder: Path) -> None:
        origin = made_once("shared_room", write_shared_room)
        folder.mkdir()
        shutil.copytree(origin / "map", folder / "map")
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("GSLTS_ROBOT", name)
            robot = Controller(home, **change_room.SIZE, noise=noise, seed=start)
            robot.go(change_room.VIEWPOINTS[start])
            done = gslts.update_map(
                folder / "map",
                robot,
                update_room.UPDATE,
                detection=change_room.CONFIG,
            )
        assert done.status == "updated"

    return made_once(f"shared_room_{name}", make) / "map"


def write_shared_room(folder: Path) -> None:
    folder.mkdir()
    change_room.write_room_map(folder / "map")
    push_map(folder / "map", f"file://{folder}/bucket")


@pytest.fixture
def shared(tmp_path: Path) -> Path:
    """Return a folder with a copy of the bucket."""
    origin = made_once("shared_room", write_shared_room)
    shutil.copytree(origin / "bucket", tmp_path / "bucket")
    return tmp_path


def join(shared: Path, *clones: Path) -> list[Path]:
    """Copy clones."""
    return [shutil.copytree(clone, shared / f"{k}") for k, clone in enumerate(clones)]


def test_a_change_that_the_map_shows_already_is_given_up(shared: Path) -> None:
    home = update_room.changed_home("removal")
    first, second = join(shared, updated("first", home), updated("second", home))
    url = f"file://{shared}/bucket"
    push_map(first, url)
    done = push_map(second, url)
    assert done.given_up == ("the map shows it already, since version 2 of first",)
    assert done.pushed == 0
    assert_same(read_map(first), read_map(second))


@pytest.mark.parametrize("kind", ["addition", "relocation"])
def test_a_change_that_two_robots_saw_differently_is_there_once(
    shared: Path, kind: update_room.Kind
) -> None:
    """Other viewpoints and noisy depth give the second robot other Gaussians of the object."""
    home = update_room.changed_home(kind)
    first, second = join(
        shared,
        updated(f"exact_{kind}", home),
        updated(f"noisy_{kind}", home, start=1, noise="kinect"),
    )
    assert_gives_up(shared, first, second)


@pytest.mark.parametrize("shift_m", [0.02, 0.05, 0.1])
def test_a_change_that_two_robots_saw_at_other_positions_is_there_once(
    shared: Path, shift_m: float
) -> None:
    """The position of one robot in the map was wrong by so much."""
    room = change_room.home()
    elsewhere = change_room.thing("Box|3", 2.6 + shift_m, 1.7, change_room.YELLOW, "Block|1")
    home = replace(room, objects=(*room.objects, elsewhere))
    first, second = join(
        shared,
        updated("yellow", update_room.changed_home("addition")),
        updated(f"yellow_{shift_m}", home),
    )
    assert_gives_up(shared, first, second)


def assert_gives_up(shared: Path, first: Path, second: Path) -> None:
    """Assert that the only change of the second clone is given up for that of the first one."""
    url = f"file://{shared}/bucket"
    push_map(first, url)
    with open_map(first) as seen, open_map(second) as seen_otherwise:
        assert seen.version().delta != seen_otherwise.version().delta
    done = push_map(second, url)
    assert (done.pushed, done.replayed, len(done.given_up)) == (0, 0, 1)
    assert_same(read_map(first), read_map(second))


def test_another_change_of_the_region_counts(shared: Path) -> None:
    red = update_room.changed_home("removal")
    yellow = update_room.changed_home("addition")
    first, second = join(shared, updated("first", red), updated("yellow", yellow))
    url = f"file://{shared}/bucket"
    push_map(first, url)
    done = push_map(second, url)
    assert (done.pushed, done.replayed, done.given_up) == (1, 1, ())
    final = read_map(second)
    assert update_room.opaque_in(final, update_room.REMOVED, 0.04) == 0
    assert update_room.opaque_in(final, update_room.ADDED, 0.0) > 20


def test_a_part_of_an_update_is_given_up(shared: Path) -> None:
    red = update_room.changed_home("removal")
    both = replace(red, objects=(*red.objects, update_room.yellow()))
    first, second = join(shared, updated("first", red), updated("both", both))
    url = f"file://{shared}/bucket"
    push_map(first, url)
    done = push_map(second, url)
    assert done.given_up == ("the map shows it already, since version 2 of first",)
    assert (done.pushed, done.replayed) == (1, 1)
    with open_map(second) as store:
        cause, (rejection,) = store.version().cause, store.rejections()
        (event,) = (event for event in store.events() if event.version == 3)
    assert isinstance(cause, UpdateCause)
    assert [change.kind for change in cause.changes] == ["addition"]
    assert [change.kind for change in rejection.cause.changes] == ["removal"]
    assert event.kind == "addition"
    assert update_room.opaque_in(read_map(second), update_room.ADDED, 0.0) > 20
    pull_map(first)
    assert_same(read_map(first), read_map(second))


def test_the_later_of_two_contradicting_changes_counts(shared: Path) -> None:
    early = updated("early", update_room.changed_home("relocation"))
    late = updated("late", update_room.changed_home("addition"))
    second, first = join(shared, early, late)
    url = f"file://{shared}/bucket"
    push_map(first, url)
    assert push_map(second, url).given_up == ("version 2 of late saw the object later",)
    assert_same(read_map(first), read_map(second))
