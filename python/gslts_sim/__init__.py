"""Simulated homes, their sensors, a robot in them, and changes of the scene."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

# Imported at first use: `gslts --help` also lists the commands of this package.
_MODULE_OF = {
    "ROOM_TYPES": "gslts_sim.procedural.homes",
    "AreaLight": "gslts_sim.home",
    "Home": "gslts_sim.home",
    "HomeObject": "gslts_sim.home",
    "Room": "gslts_sim.home",
    "Surface": "gslts_sim.mesh",
    "load_home": "gslts_sim.gltf.load",
    "make_home": "gslts_sim.procedural.homes",
    "write_glb": "gslts_sim.gltf.write",
}


def __getattr__(name: str) -> Any:
    """Import a public name and keep it (PEP 562).

    Raises:
        AttributeError: There is no such name.
    """
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'gslts_sim' has no attribute {name!r}")
    value = getattr(import_module(_MODULE_OF[name]), name)
    globals()[name] = value
    return value
