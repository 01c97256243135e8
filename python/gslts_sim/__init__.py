"""Simulated homes, their sensors, a robot in them, and changes of the scene."""

from gslts_sim.gltf.load import load_home
from gslts_sim.gltf.write import write_glb
from gslts_sim.home import AreaLight, Home, HomeObject, Room
from gslts_sim.mesh import Surface
from gslts_sim.procedural.homes import ROOM_TYPES, make_home

__all__ = [
    "ROOM_TYPES",
    "AreaLight",
    "Home",
    "HomeObject",
    "Room",
    "Surface",
    "load_home",
    "make_home",
    "write_glb",
]
