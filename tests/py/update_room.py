"""Changes of the room of `change_room`, and what a robot collects of them."""

from dataclasses import replace
from functools import cache
from typing import Literal

import change_room
import numpy as np
from change_room import BLUE, LOOKS, SIZE, YELLOW

from gslts.change.changes import Change
from gslts.gaussian_map import GaussianMap
from gslts.sim.controller import Controller
from gslts.sim.home import Home, HomeObject
from gslts.update.collect import Collection, collect
from gslts.update.config import CollectConfig

Kind = Literal["removal", "addition", "relocation"]
COLLECT = CollectConfig(distance_m=1.0)
REMOVED = (np.array([2.08, 1.73, 0.75]), np.array([2.32, 1.97, 1.05]))
"""Corners of the red box that goes."""
ADDED = (np.array([2.48, 1.58, 0.75]), np.array([2.72, 1.82, 1.05]))
"""And of the yellow one that comes."""


def yellow() -> HomeObject:
    return change_room.thing("Box|3", 2.6, 1.7, YELLOW, "Block|1")


def changed_home(kind: Kind) -> Home:
    home = change_room.home()
    if kind == "removal":
        return home.without(["Box|1"])
    if kind == "addition":
        return replace(home, objects=(*home.objects, yellow()))
    moved = replace(change_room.thing("Box|2", 2.6, 1.7, BLUE, "Block|1"))
    return replace(home.without(["Box|2"]), objects=(*home.without(["Box|2"]).objects, moved))


def robot_in(home: Home, noise: str = "none") -> Controller:
    """A robot that looks at the block."""
    robot = Controller(home, **SIZE, noise=noise)
    robot.go(LOOKS[0])
    return robot


@cache
def detected(kind: Kind) -> Change:
    """What the first frame tells."""
    change = change_room.detector().detect(robot_in(changed_home(kind)).observe()).changes[0]
    assert change.kind == kind
    return change


@cache
def collected(kind: Kind) -> Collection:
    found = collect(robot_in(changed_home(kind)), change_room.detector(), [detected(kind)], COLLECT)
    assert found.changes == (detected(kind),)
    return found


def opaque_in(
    gaussian_map: GaussianMap, box: tuple[np.ndarray, np.ndarray], margin_m: float
) -> int:
    """How many Gaussians that can be seen have their centres in a box, but for a margin."""
    low, high = box[0] + margin_m, box[1] - margin_m
    inside = ((gaussian_map.means > low) & (gaussian_map.means < high)).all(axis=1)
    return int((inside & (gaussian_map.logit_opacities > np.log(0.05 / 0.95))).sum())
