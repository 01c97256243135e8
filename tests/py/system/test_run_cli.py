"""The command `gslts run`, as a user meets it."""

import signal
from pathlib import Path

import change_room
import pytest
import update_room
from command import gslts, stopped_at
from update_room import viewpoints_of_the_change

from gslts.fleet.exchange import clone_map, pull_map, push_map
from gslts.keeper.state import KeeperState, read_state, write_state
from gslts.store.map_folder import open_map, read_map
from gslts_sim.capture import capture

QUICK = ("--iterations", "20", "--threads", "1")
FSYNCS = (1, 3, 9, 7, 5, 6)
"""Calls at which runs are killed in turn: while states, a version and its image are written."""


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recording after the red box was removed."""
    folder = tmp_path_factory.mktemp("run")
    home = update_room.changed_home("removal")
    capture(update_room.robot_in(home), viewpoints_of_the_change(), folder / "visit")
    return folder


@pytest.fixture
def new_map(workplace: Path, request: pytest.FixtureRequest) -> str:
    """Return the name of a new map."""
    name = f"map_of_{request.node.name}"
    change_room.write_room_map(workplace / name)
    return name


@pytest.mark.smoke
def test_a_recording_updates_a_map(workplace: Path, new_map: str) -> None:
    done = gslts("run", new_map, "--frames", "visit", *QUICK, cwd=workplace)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("removal at (2.")
    assert lines[-1] == (
        f"1 round(s); {new_map} is version 2 now, 0 deferred; see gslts log {new_map}"
    )
    new = read_map(workplace / new_map)
    assert update_room.opaque_in(new, update_room.REMOVED, 0.04) == 0
    page = workplace / "log.html"
    done = gslts("log", new_map, "--html", str(page), cwd=workplace)
    assert done.returncode == 0, done.stderr
    text = page.read_text()
    assert "object removed from (2." in text
    assert text.count('src="data:image/jpeg') == 1


def test_a_simulated_day(workplace: Path, new_map: str) -> None:
    done = gslts(
        *("sim", "day", "kitchen", "20", "--changes", "2", "--frames", "9", "--out", "day"),
        *("--width", "64", "--height", "48"),
        cwd=workplace,
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert [line[:15] for line in lines[:2]] == ["before round 0:", "before round 1:"]
    assert lines[2].startswith("wrote day/day.json and 9 frames to day/before")
    # A map of another home: every frame is unreliable, and nothing is changed.
    done = gslts("run", new_map, "--robot", "day/day.json", *QUICK, cwd=workplace)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        f"2 round(s); {new_map} is version 1 now, 0 deferred; see gslts log {new_map}"
    ]
    assert read_state(workplace / new_map).round == 2
    done = gslts("run", new_map, "--robot", "day/day.json", *QUICK, cwd=workplace)
    assert done.stdout.startswith("0 round(s)"), "all rounds of the day are done"
    day = workplace / "day" / "day.json"
    day.with_name("next.json").write_text(day.read_text() + "\n")  # Another one.
    done = gslts("run", new_map, "--robot", "day/next.json", *QUICK, cwd=workplace)
    assert done.stdout.startswith("2 round(s)"), done.stderr
    assert read_state(workplace / new_map).round == 4


def test_another_recording_starts_with_its_first_round(workplace: Path, new_map: str) -> None:
    state = KeeperState(round=3, source="another one", source_rounds=2, remaining=("nowhere",))
    write_state(state, workplace / new_map)
    done = gslts("run", new_map, "--frames", "visit", *QUICK, cwd=workplace)
    assert done.stdout.splitlines()[-1].startswith(f"1 round(s); {new_map} is version 2 now")
    after = read_state(workplace / new_map)
    assert (after.round, after.source_rounds) == (4, 1)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_run_and_the_next_one_continues(
    workplace: Path, new_map: str, number: signal.Signals
) -> None:
    at_the_first_state = stopped_at("gslts.keeper.keeper:write_state", 1, number)
    arguments = ("run", new_map, "--frames", "visit", *QUICK)
    done = gslts(*arguments, cwd=workplace, before=at_the_first_state)
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last == "gslts: stopped in round 0; the same command continues there"
    assert "Traceback" not in done.stderr
    done = gslts("run", new_map, "--frames", "visit", *QUICK, cwd=workplace)
    assert done.returncode == 0, done.stderr
    with open_map(workplace / new_map) as store:
        assert store.version().number == 2
        assert store.find_problems() == []


def test_a_killed_run_continues(workplace: Path, new_map: str) -> None:
    """Kill each run after a number of calls of fsync."""
    arguments = ("run", new_map, "--frames", "visit", *QUICK)
    printed_version = 1
    for files in FSYNCS:
        killed = gslts(*arguments, cwd=workplace, before=stopped_at("os:fsync", files))
        assert killed.returncode == -signal.SIGKILL
        printed_version = max(printed_version, 2 if "version 2: " in killed.stdout else 1)
        with open_map(workplace / new_map) as store:
            assert store.find_problems() == []
            assert store.version().number in (printed_version, 2)
    done = gslts("run", new_map, "--frames", "visit", *QUICK, cwd=workplace)
    assert done.returncode == 0, done.stderr
    with open_map(workplace / new_map) as store:
        assert store.version().number == 2
    new = read_map(workplace / new_map)
    assert update_room.opaque_in(new, update_room.REMOVED, 0.04) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "give either --robot or --frames"),
        (("--frames", "visit", "--robot", "day.json"), "give either --robot or --frames"),
        (("--frames", "nowhere"), "nowhere"),
        (("--robot", "nowhere.json"), "nowhere.json"),
    ],
)
def test_bad_input_is_named_in_one_line(
    workplace: Path, new_map: str, arguments: tuple[str, ...], message: str
) -> None:
    done = gslts("run", new_map, *arguments, cwd=workplace)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("gslts: ")
    assert message in line


def test_a_second_writer_is_rejected(workplace: Path, new_map: str) -> None:
    with open_map(workplace / new_map, writable=True):
        done = gslts("run", new_map, "--frames", "visit", *QUICK, cwd=workplace)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].endswith(
        "another process writes this map; wait until it ends"
    )


def test_versions_are_exchanged_after_each_round(workplace: Path, new_map: str) -> None:
    run = ("run", new_map, "--frames", "visit", "--share", "--rounds", "2", *QUICK)
    done = gslts(*run, cwd=workplace)
    assert (
        done.stderr
        == f"gslts: {new_map}: it was never shared: gslts push {new_map} URL shares it\n"
    )
    url = f"file://{workplace}/bucket"
    push_map(workplace / new_map, url)
    clone_map(url, workplace / "other")
    with open_map(workplace / "other", writable=True) as store:
        store.restore(1)
    push_map(workplace / "other")
    done = gslts(*run, cwd=workplace)
    assert done.returncode == 0, done.stderr
    shared = [line for line in done.stdout.splitlines() if line.startswith("shared")]
    assert shared == [
        "shared version 3: 1 pulled, 1 pushed",
        "shared version 3: 0 pulled, 0 pushed",
    ]
    assert done.stdout.splitlines()[-1].startswith(f"2 round(s); {new_map} is version 3 now")
    pull_map(workplace / "other")
    assert update_room.opaque_in(read_map(workplace / "other"), update_room.REMOVED, 0.04) == 0
