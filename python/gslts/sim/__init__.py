"""Simulated homes, their sensors, a robot in them, and changes of the scene."""

from gslts.sim.gltf.load import load_home
from gslts.sim.gltf.write import write_glb
from gslts.sim.home import AreaLight, Home, HomeObject, Room
from gslts.sim.mesh import Surface
from gslts.sim.procedural.homes import ROOM_TYPES, make_home

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
