"""Episodes of navigation: start of a robot in a home, and category to go to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gslts.types import Floats, Ints
from gslts_bench.homes import movable_types
from gslts_bench.navigation.truth import Truth
from gslts_sim.home import Home

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
"""Categories by room type: those of SAVN (Wortsman et al. 2019) first, then those of GS-LTS,
sec. IV-D, that occur in our homes."""
MIN_PATH_M = 0.5
"""Minimum shortest path of an episode; nearer starts need a turn only."""


@dataclass(frozen=True)
class Episode:
    """Task of a robot: go to an object of a category.

    Attributes:
        name: Home and number.
        room_type: Room type of the home.
        category: Type of object to go to.
        position: x and y of the start, m.
        yaw_deg: Direction of the robot at the start.
        shortest_m: Length of the shortest path on the robot's grid to a position within 1 m of such
            an object that sees it.
    """

    name: str
    room_type: str
    category: str
    position: tuple[float, float]
    yaw_deg: float
    shortest_m: float


def categories_of(room_type: str, home: Home) -> Sequence[str]:
    """Return the categories that a robot goes to in a home.

    Args:
        room_type: One of `CATEGORIES`; another one, of a foreign home, means its movable objects.
        home: The home.
    """
    return CATEGORIES.get(room_type) or movable_types(home)


def starts_to(truth: Truth, category: str) -> tuple[Floats, Ints]:
    """Find starts with a path to objects of a category.

    Args:
        truth: Ground truth of the home.
        category: The category.

    Returns:
        [P] length of the shortest path from each position of the home, m; and the numbers of the
        positions with a path of at least `MIN_PATH_M`.
    """
    metres = truth.metres_to(truth.goals(category))
    return metres, np.flatnonzero(np.isfinite(metres) & (metres >= MIN_PATH_M))


def episodes_of(truth: Truth, room_type: str, name: str, seed: int, count: int) -> list[Episode]:
    """Draw episodes in one home; the first ones do not depend on their number.

    Args:
        truth: Ground truth of the home.
        room_type: Room type, whose categories are goals, in turn, as far as they can be reached.
        name: Name of the home.
        seed: Seed of the starts.
        count: Number of episodes.

    Returns:
        The episodes.

    Raises:
        ValueError: No category can be reached.
    """
    rng = np.random.default_rng([seed, [*sorted(CATEGORIES), room_type].index(room_type)])
    known = {
        category: starts_to(truth, category) for category in categories_of(room_type, truth.home)
    }
    wanted = [category for category, (_, starts) in known.items() if len(starts)]
    if not wanted:
        raise ValueError(f"{name}: none of {', '.join(known)} can be reached")
    result: list[Episode] = []
    while len(result) < count:
        for category in rng.permutation(wanted).tolist():
            metres, starts = known[category]
            start = int(rng.choice(starts))
            x, y = truth.positions[start].tolist()
            result.append(
                Episode(
                    name=f"{name}/{len(result):03}",
                    room_type=room_type,
                    category=category,
                    position=(x, y),
                    yaw_deg=float(rng.integers(8) * 45),
                    shortest_m=float(metres[start]),
                )
            )
    return result[:count]
