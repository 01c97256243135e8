"""
PLY files of maps.
"""
from __future__ import annotations
import gslts._core.map
import numpy
import os
import typing
__all__: list[str] = ['read_ply', 'write_ply']
def read_ply(path: os.PathLike | str | bytes) -> tuple[dict[str, numpy.ndarray], list[str]]:
    """
    See gslts.io.ply.read_ply; returns the arrays of the map by name, and the names of the properties that it ignored.
    """
def write_ply(gaussians: gslts._core.map.GaussianViewFloat, ids: numpy.ndarray, path: os.PathLike | str | bytes) -> None:
    """
    See gslts.io.ply.write_ply.
    """
