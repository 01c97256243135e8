"""Homes of several rooms."""

from dataclasses import replace

import numpy as np
import sim_scenes

from gslts_sim import make_home
from gslts_sim.home import Home, Room


def bare_flat(*corners: tuple[float, float, float, float], blocks: tuple[tuple, ...] = ()) -> Home:
    """Return rooms from x0, y0, x1, y1, m, without walls, with blocks of 1 m height."""
    rooms = tuple(
        Room("room", np.array([[x0, y0, 0], [x1, y1, 2.5]], float)) for x0, y0, x1, y1 in corners
    )
    floors = [
        sim_scenes.box_object(f"Floor|{k}", (x0, y0, -0.1), (x1, y1, 0), sim_scenes.plain(150))
        for k, (x0, y0, x1, y1) in enumerate(corners)
    ]
    walls = [
        sim_scenes.box_object(f"Wall|{k}", (x0, y0, 0), (x1, y1, 1), sim_scenes.plain(200))
        for k, (x0, y0, x1, y1) in enumerate(blocks)
    ]
    return Home("flat", rooms, (*floors, *walls), (), np.ones(3))


def furnished_flat(*made: tuple[str, int, tuple[float, float]], detail: float = 0.1) -> Home:
    """Return rooms of `make_home` by type, seed and corner, with `|room` added to ids."""
    rooms, objects, lights = [], [], []
    for k, (room_type, seed, corner) in enumerate(made):
        home = make_home(room_type, seed, detail=detail)
        shift = np.eye(4)
        shift[:2, 3] = np.array(corner) - home.rooms[0].box[0, :2]
        rooms += [replace(room, box=room.box + shift[:3, 3]) for room in home.rooms]
        for obj in home.objects:
            parent = None if obj.parent is None else f"{obj.parent}|{k}"
            placed = obj.place_at(shift @ obj.world_from_object, parent)
            objects.append(replace(placed, id=f"{obj.id}|{k}"))
        for light in home.lights:
            owner = None if light.owner is None else f"{light.owner}|{k}"
            lights.append(replace(light, center=light.center + shift[:3, 3], owner=owner))
    return Home("flat", tuple(rooms), tuple(objects), tuple(lights), home.ambient)
