"""
Shortest paths over a grid.
"""
from __future__ import annotations
import numpy
import numpy.typing
import typing
__all__: list[str] = ['distance_field']
def distance_field(free: numpy.ndarray, goals: numpy.ndarray, *, cell_m: typing.SupportsFloat | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
    """
    See gslts.navigation.planner.distance_field_m.
    """
