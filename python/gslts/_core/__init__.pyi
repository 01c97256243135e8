"""
C++ core of gslts: strict and thin; the package gslts is its public face.
"""
from __future__ import annotations
from . import simd
from . import map
from . import io
from . import fusion
from . import raster
from . import optim
from . import align
from . import detect
from . import edit
from . import plan
from . import reloc
from . import sim
__all__: list[str] = ['align', 'detect', 'edit', 'fusion', 'io', 'map', 'optim', 'plan', 'raster', 'reloc', 'sim', 'simd']
