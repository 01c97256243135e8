"""
Direct image alignment.
"""
from __future__ import annotations
import gslts._core.map
import gslts._core.optim
import numpy
import numpy.typing
import typing
__all__: list[str] = ['align_double', 'align_float']
def align_double(camera: gslts._core.map.Camera, rgb: numpy.ndarray, depth: numpy.ndarray, photo: numpy.ndarray, measured: numpy.ndarray, *, mask: numpy.ndarray | None, exposure: gslts._core.optim.Exposure, threads: int) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 10]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 1]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 10]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 1]"]]:
    """
    See gslts.localization.alignment.align; returns hessian and right side of colour, and of depth.
    """
def align_float(camera: gslts._core.map.Camera, rgb: numpy.ndarray, depth: numpy.ndarray, photo: numpy.ndarray, measured: numpy.ndarray, *, mask: numpy.ndarray | None, exposure: gslts._core.optim.Exposure, threads: int) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 10]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 1]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 10]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 1]"]]:
    """
    See gslts.localization.alignment.align; returns hessian and right side of colour, and of depth.
    """
