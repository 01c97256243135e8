"""Generation of furnished rooms from a seed."""

from __future__ import annotations

import numpy as np

from gslts_sim.home import Home
from gslts_sim.physics import problems
from gslts_sim.procedural.flat import join_rooms
from gslts_sim.procedural.model import Kit
from gslts_sim.procedural.rooms import bedroom, kitchen, living_room
from gslts_sim.procedural.scene import Scene
from gslts_sim.walkable import walkable_floor

ROOM_TYPES = {"kitchen": kitchen, "living_room": living_room, "bedroom": bedroom}
"""Module that furnishes each type of room."""
FLAT = "flat"
HOME_TYPES = (*ROOM_TYPES, FLAT)
"""All that `make_home` makes."""
MIN_MOVABLE = 10
"""Minimum number of movable objects of an accepted room."""
MIN_REACHED_FRACTION = 0.62
"""Minimum fraction of the free floor that a robot of 0.2 m radius and 1.2 m height reaches."""
MAX_ATTEMPTS = 20
"""Maximum number of rooms that are generated until one is accepted."""
AMBIENT = (0.38, 0.38, 0.39)
"""Ambient light, linear RGB."""


def make_home(room_type: str, seed: int, *, detail: float = 1.0) -> Home:
    """Generate a furnished home; bit-identical for the same arguments.

    Args:
        room_type: `kitchen`, `living_room`, `bedroom`, or `flat`: all three at a hall.
        seed: 0 to 2^63 - 1.
        detail: Scale of the resolution of textures; shapes and poses do not depend on it.

    Raises:
        ValueError: There is no such room type, or the seed is not such a number.
    """
    if not isinstance(room_type, str) or room_type not in HOME_TYPES:
        known = ", ".join(HOME_TYPES)
        raise ValueError(f"make_home: room_type: expected one of {known}, got {room_type!r}")
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed < 2**63:
        raise ValueError(f"make_home: seed: expected an int from 0 to 2^63 - 1, got {seed!r}")
    if room_type == FLAT:
        rooms = [make_home(name, seed, detail=detail) for name in ROOM_TYPES]
        return join_rooms(f"flat {seed}", rooms, Kit((int(seed), 3), detail), np.array(AMBIENT))
    plan = ROOM_TYPES[room_type]
    for attempt in range(MAX_ATTEMPTS):
        kit = Kit((int(seed), list(ROOM_TYPES).index(room_type), attempt), detail)
        scene = Scene(kit, room_type, plan.draw_size(kit.rng))
        plan.furnish(scene)
        home = scene.home(f"{room_type} {seed}", np.array(AMBIENT))
        if _is_accepted(home):
            return home
    raise AssertionError(f"make_home: {room_type} {seed}: no room accepted in {MAX_ATTEMPTS} tries")


def _is_accepted(home: Home) -> bool:
    movable = sum(obj.movable for obj in home.objects)
    if movable < MIN_MOVABLE or problems(home):
        return False
    return walkable_floor(home, home.rooms[0]).reached_fraction >= MIN_REACHED_FRACTION
