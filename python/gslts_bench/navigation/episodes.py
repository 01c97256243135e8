"""Episodes of navigation: where a robot starts in a home, and what it is to go to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.types import Floats
from gslts_bench.navigation.truth import Truth

CATEGORIES = {
    "kitchen": (
        *("Toaster", "Microwave", "Fridge", "CoffeeMachine", "GarbageCan", "Box", "Bowl"),
        *("Bread", "Chair"),
    ),
    "living_room": (
        *("Pillow", "Laptop", "Television", "GarbageCan", "Box", "Bowl"),
        *("Sofa", "ArmChair", "DeskLamp", "RemoteControl", "HousePlant"),
    ),
    "bedroom": (
        *("HousePlant", "DeskLamp", "Book", "AlarmClock"),
        *("Bed", "Dresser", "Dumbbell", "Chair", "Laptop"),
    ),
}
"""The types of SAVN (Wortsman et al. 2019) first, then those of GS-LTS, sec. IV-D, that occur in
our homes."""
LEAST_M = 0.5
"""Of the shortest way: nearer starts ask for a turn only."""


@dataclass(frozen=True)
class Episode:
    """One task.

    Attributes:
        name: Of the home, and the number of the episode.
        room_type: Of the home.
        category: Type of object to go to.
        place: x and y of the start, m.
        yaw_deg: Direction in which the robot looks at the start.
        shortest_m: Way on the robot's grid to the nearest place within 1 m of such an object from
            which it can be seen.
    """

    name: str
    room_type: str
    category: str
    place: tuple[float, float]
    yaw_deg: float
    shortest_m: float


def starts_to(truth: Truth, category: str) -> tuple[Floats, NDArray[np.intp]]:
    """From where objects of a type can be gone to.

    Returns:
        [P] shortest way from each of the places of the home, m; and the numbers of those from
        which there is a way, and not too short a one.
    """
    metres = truth.metres_to(truth.goals(category))
    return metres, np.flatnonzero(np.isfinite(metres) & (metres >= LEAST_M))


def episodes_of(truth: Truth, room_type: str, name: str, seed: int, count: int) -> list[Episode]:
    """Episodes in one home; the first ones do not depend on how many there are.

    Args:
        truth: Of the home.
        room_type: Whose `CATEGORIES` are gone to, in turn, as far as the home has them and they can
            be reached.
        name: Of the home.
        seed: Of starts.
        count: How many.

    Raises:
        ValueError: Nothing in the home can be gone to.
    """
    rng = np.random.default_rng([seed, sorted(CATEGORIES).index(room_type)])
    known = {one: starts_to(truth, one) for one in CATEGORIES[room_type]}
    wanted = [one for one, (_, places) in known.items() if len(places)]
    if not wanted:
        raise ValueError(f"{name}: none of {', '.join(known)} can be gone to")
    result: list[Episode] = []
    while len(result) < count:
        for category in rng.permutation(wanted).tolist():
            metres, starts = known[category]
            place = int(rng.choice(starts))
            x, y = truth.places[place].tolist()
            result.append(
                Episode(
                    name=f"{name}/{len(result):03}",
                    room_type=room_type,
                    category=category,
                    place=(x, y),
                    yaw_deg=float(rng.integers(8) * 45),
                    shortest_m=float(metres[place]),
                )
            )
    return result[:count]
