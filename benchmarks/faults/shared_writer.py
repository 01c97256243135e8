"""A robot that changes rooms of a shared map and pushes, until it has done so often enough.

It prints one line of JSON after each commit and after each push: what it may count on from then on.
"""

from __future__ import annotations

import json
import os
import random
from pathlib import Path

from synthetic_rooms import ROOMS_X_M, change_room

from gslts.fleet.exchange import push_map
from gslts.store.causes import UpdateCause
from gslts.store.map_folder import open_map
from gslts.store.robot_name import VARIABLE, robot_name

SHARED_ROOM = len(ROOMS_X_M) - 1
"""Room that all robots change; each has another one for itself."""
SHARED_RATE, PUSH_RATE = 0.2, 0.7
"""Share of the updates that are of the shared room, and of those after which the robot pushes: else
it works on as if it were offline."""


def work(folder: Path, url: str, room: int, updates: int) -> None:
    """Commit updates and push them.

    Args:
        folder: Clone of the map.
        url: Of the map.
        room: Of this robot, and its number.
        updates: Number of updates.
    """
    os.environ[VARIABLE] = f"robot{room}"
    rng = random.Random()
    for _ in range(updates):
        number = 1 + max({*own_rounds(folder).values(), *given_up_rounds(folder)}, default=0)
        version = change_room(folder, SHARED_ROOM if rng.random() < SHARED_RATE else room, number)
        report("committed", {version.number: number})
        if rng.random() < PUSH_RATE:
            try:
                push_map(folder, url)
            except OSError as error:
                report("failed", str(error))
            else:
                report("pushed", own_rounds(folder))


def report(event: str, content: object) -> None:
    """Print what exists now: rounds by the number of their versions, or why a push failed."""
    print(json.dumps([event, content]), flush=True)


def own_rounds(folder: Path) -> dict[int, int]:
    """Return the rounds of the updates of this robot by number of the version."""
    with open_map(folder) as store:
        return {
            version.number: version.cause.round
            for version in store.versions()
            if isinstance(version.cause, UpdateCause)
            and version.cause.round is not None
            and version.robot == robot_name()
        }


def given_up_rounds(folder: Path) -> set[int]:
    """Return the rounds of the updates of this robot that were given up."""
    with open_map(folder) as store:
        return {
            rejection.cause.round
            for rejection in store.rejections()
            if rejection.cause.round is not None and rejection.robot == robot_name()
        }
