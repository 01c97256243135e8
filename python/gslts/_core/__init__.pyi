"""
C++ core of gslts: strict and thin; the package gslts is its public face.
"""
from __future__ import annotations
from . import map
from . import raster
from . import detect
from . import edit
from . import reloc
from . import sim
__all__: list[str] = ['detect', 'edit', 'map', 'raster', 'reloc', 'sim']
