"""The map of `change_room`, taught what its labels say."""

from dataclasses import replace
from functools import cache

import change_room

from gslts.frame import RgbdFrame
from gslts.gaussian_map import GaussianMap
from gslts.sim.explore import explore
from gslts.sim.robot_body import Look
from gslts.tasks.embed import Embedded, embedded
from gslts.tasks.meaning import Meaning
from gslts.tasks.semantics import Oracle


@cache
def looks() -> list[Look]:
    """Some all around the room, and those at the block."""
    return [*explore(change_room.home(), 16)[0], *change_room.LOOKS]


def frames() -> list[RgbdFrame]:
    return [change_room.see(change_room.home(), look) for look in looks()]


@cache
def taught() -> tuple[GaussianMap, Embedded]:
    gaussian_map, _ = change_room.mapped()
    found = embedded(gaussian_map, frames(), Oracle(), 8, threads=1)
    return replace(gaussian_map, features=found.features), found


def meaning() -> Meaning:
    _, found = taught()
    return Meaning(Oracle(), found.autoencoder, found.names)
