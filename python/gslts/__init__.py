"""Photorealistic, semantic 3D Gaussian maps that keep themselves up to date."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gslts import losses
    from gslts.adam import Adam, AdamOptions, AdamRates, AdamState
    from gslts.camera import Camera, camera_from_fov, look_at
    from gslts.gaussian_map import GaussianMap
    from gslts.ply import read_ply, write_ply
    from gslts.rasterizer import (
        Gradients,
        Images,
        LiftedFeatures,
        Rasterizer,
        RenderOptions,
        render,
    )

    __version__: str

__all__ = [
    "Adam",
    "AdamOptions",
    "AdamRates",
    "AdamState",
    "Camera",
    "GaussianMap",
    "Gradients",
    "Images",
    "LiftedFeatures",
    "Rasterizer",
    "RenderOptions",
    "__version__",
    "camera_from_fov",
    "look_at",
    "losses",
    "read_ply",
    "render",
    "write_ply",
]

# Imported when first used: NumPy and the extension take most of the time of a short command.
_MODULES = {
    "gslts.adam": ("Adam", "AdamOptions", "AdamRates", "AdamState"),
    "gslts.camera": ("Camera", "camera_from_fov", "look_at"),
    "gslts.gaussian_map": ("GaussianMap",),
    "gslts.ply": ("read_ply", "write_ply"),
    "gslts.rasterizer": (
        "Gradients",
        "Images",
        "LiftedFeatures",
        "Rasterizer",
        "RenderOptions",
        "render",
    ),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Imports a public name (PEP 562) and keeps it.

    Raises:
        AttributeError: There is no such name.
    """
    value: Any
    if name == "__version__":
        from importlib.metadata import version

        value = version("gslts")
    elif name == "losses":
        value = import_module("gslts.losses")
    elif name in _MODULE_OF:
        value = getattr(import_module(_MODULE_OF[name]), name)
    else:
        raise AttributeError(f"module 'gslts' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
