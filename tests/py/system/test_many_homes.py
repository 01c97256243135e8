"""Tests of homes of many seeds, and of tasks in them."""

import multiprocessing
from pathlib import Path

import home_checks
import pytest

from gslts_sim import ROOM_TYPES
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.tasks import TaskMaker, generate_tasks, homes_of


@pytest.mark.long
def test_hundred_homes_of_each_type_are_sound():
    seeds = [(room_type, seed) for room_type in ROOM_TYPES for seed in range(100)]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = pool.starmap(home_checks.complaints, seeds, chunksize=10)
    assert [complaint for of_home in found for complaint in of_home] == []


@pytest.mark.long
def test_every_task_of_many_homes_replays() -> None:
    """Tasks replay also if the robot's start is where an object goes."""
    maker = TaskMaker(TaskSettings(width=16, height=16), 0)
    made = list(generate_tasks(["kitchen", "living_room"], Path(), 0, 48, 12, maker))
    assert len(made) == 48
    homes = {
        source: home
        for (source, home), _ in zip(
            homes_of(["kitchen", "living_room"], Path(), 0), range(4), strict=False
        )
    }
    for task in made:
        for changed in (False, True):
            robot = task.start(homes[task.home], changed=changed)
            assert (task.change.object_id in robot.home) == (
                (task.change.box_after if changed else task.change.box_before) is not None
            )
