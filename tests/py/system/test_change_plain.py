"""Changes of another detector: plain values with boxes are confirmed by views of the robot."""

import change_room
import numpy as np
import update_room
from update_room import COLLECT, REMOVED

from gslts.change.changes import Change
from gslts.update.view_collection import collect_views


def test_a_plain_removal_is_confirmed_by_views() -> None:
    plain = Change("removal", 0.6, np.mean(REMOVED, axis=0), (REMOVED, None))
    robot = update_room.robot_in(update_room.changed_home("removal"))
    found = collect_views(robot, change_room.detector(), [plain], COLLECT)
    (change,) = found.changes
    assert change.kind == "removal"
    assert len(found.views) > 3


def test_a_plain_removal_of_an_object_that_stands_there_is_rejected() -> None:
    plain = Change("removal", 0.6, np.mean(REMOVED, axis=0), (REMOVED, None))
    robot = update_room.robot_in(change_room.home())
    found = collect_views(robot, change_room.detector(), [plain], COLLECT)
    assert found.changes == ()
    assert len(found.rejected) == 1
