"""Days of a home: scripts of what changes between the rounds of a robot."""

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
    kinds = [one.change.kind for happened in day.rounds for one in happened]
    assert len(kinds) == 6
    assert set(kinds) == {"addition", "removal", "relocation"}
    assert [len(happened) for happened in day.rounds] == [1, 1, 2, 1, 1]
    pair = day.rounds[2]
    assert pair[0].change.object_id != pair[1].change.object_id


def test_each_round_finds_what_happened_before_it(
    day: Day, source_and_home: tuple[HomeSource, Home]
) -> None:
    _, home = source_and_home
    for gone, happened in enumerate(day.rounds, start=1):
        before, after = day.state(home, gone - 1).home, day.state(home, gone).home
        for one in happened:
            change = one.change
            for state, box in ((before, change.box_before), (after, change.box_after)):
                assert (change.object_id in state) == (box is not None)
                if box is not None:
                    assert np.allclose(state[change.object_id].box_in_world, box, atol=1e-5)
    last = day.state(home, len(day.rounds)).home
    assert {one.id for one in day.state(home, 99).home.objects} == {one.id for one in last.objects}


def test_the_robot_sees_the_round_it_is_in(
    day: Day, source_and_home: tuple[HomeSource, Home]
) -> None:
    _, home = source_and_home
    robots = [day.robot(home, gone) for gone in (0, 1, 1, 2)]
    first, one, again, two = (robot.observe().rgb for robot in robots)
    assert first.shape == (48, 64, 3)
    assert np.array_equal(one, again)
    assert not np.array_equal(first, one)
    assert not np.array_equal(one, two)


def test_same_seed_same_day(day: Day, source_and_home: tuple[HomeSource, Home]) -> None:
    assert make_day(*source_and_home, SETTING, 20, 6) == day
    assert make_day(*source_and_home, SETTING, 21, 6) != day


def test_days_come_back_from_files(day: Day, tmp_path: Path) -> None:
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
def test_files_that_are_no_days_are_named(
    day: Day, tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = tmp_path / "day.json"
    text = day.model_dump_json()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(ValueError, match=rf"day\.json: .*{message}"):
        read_day(path)


def test_more_changes_than_a_home_allows_are_refused(
    source_and_home: tuple[HomeSource, Home],
) -> None:
    setting = TaskSettings(width=64, height=48, receptacle_id="Floor|1", object_id="Nothing|1")
    with pytest.raises(ValueError, match=r"Nothing\|1"):
        make_day(*source_and_home, setting, 20, 2)
