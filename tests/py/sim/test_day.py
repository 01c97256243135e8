"""Tests of days: scripts of the changes between the rounds of a robot."""

from pathlib import Path

import numpy as np
import pytest

from gslts_sim.change_sampler import TaskSettings
from gslts_sim.day import Day, make_day, read_day
from gslts_sim.home import Home
from gslts_sim.home_source import HomeSource

SETTING = TaskSettings(width=64, height=48)


@pytest.fixture(scope="module")
def source_and_home() -> tuple[HomeSource, Home]:
    return HomeSource.of_seed("bedroom", 20)


@pytest.fixture(scope="module")
def day(source_and_home: tuple[HomeSource, Home]) -> Day:
    return make_day(*source_and_home, SETTING, 20, 6)


def test_a_day_has_all_kinds_of_changes_and_two_at_once(day: Day) -> None:
    kinds = [event.change.kind for events in day.rounds for event in events]
    assert len(kinds) == 6
    assert set(kinds) == {"addition", "removal", "relocation"}
    assert [len(events) for events in day.rounds] == [1, 1, 2, 1, 1]
    pair = day.rounds[2]
    assert pair[0].change.object_id != pair[1].change.object_id


def test_each_round_finds_the_changes_before_it(
    day: Day, source_and_home: tuple[HomeSource, Home]
) -> None:
    _, home = source_and_home
    for rounds_over, events in enumerate(day.rounds, start=1):
        before, after = day.state(home, rounds_over - 1).home, day.state(home, rounds_over).home
        for event in events:
            change = event.change
            for state, box in ((before, change.box_before), (after, change.box_after)):
                assert (change.object_id in state) == (box is not None)
                if box is not None:
                    assert np.allclose(state[change.object_id].box_in_world, box, atol=1e-5)
    last = day.state(home, len(day.rounds)).home
    expected = {obj.id for obj in last.objects}
    assert {obj.id for obj in day.state(home, 99).home.objects} == expected


def test_the_robot_sees_the_state_of_its_round(
    day: Day, source_and_home: tuple[HomeSource, Home]
) -> None:
    _, home = source_and_home
    robots = [day.robot(home, rounds_over) for rounds_over in (0, 1, 1, 2)]
    first, changed, again, later = (robot.observe().rgb for robot in robots)
    assert first.shape == (48, 64, 3)
    assert np.array_equal(changed, again)
    assert not np.array_equal(first, changed)
    assert not np.array_equal(changed, later)


def test_same_seed_same_day(day: Day, source_and_home: tuple[HomeSource, Home]) -> None:
    assert make_day(*source_and_home, SETTING, 20, 6) == day
    assert make_day(*source_and_home, SETTING, 21, 6) != day


def test_days_are_read_back_from_files(day: Day, tmp_path: Path) -> None:
    path = tmp_path / "day.json"
    path.write_text(day.model_dump_json())
    assert read_day(path) == day


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"schema_version":1', '"schema_version":2', "schema_version is 2, this gslts reads 1"),
        ('"rounds":', '"turns":', "rounds: Field required"),
        ('"noise":"kinect"', '"noise":3', "sensor.noise: Input should be a valid string"),
    ],
)
def test_files_without_a_day_are_named(
    day: Day, tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = tmp_path / "day.json"
    text = day.model_dump_json()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(ValueError, match=rf"day\.json: .*{message}"):
        read_day(path)


def test_more_changes_than_a_home_allows_are_rejected(
    source_and_home: tuple[HomeSource, Home],
) -> None:
    setting = TaskSettings(width=64, height=48, receptacle_id="Floor|1", object_id="Nothing|1")
    with pytest.raises(ValueError, match=r"Nothing\|1"):
        make_day(*source_and_home, setting, 20, 2)
