"""Photorealistic, semantic 3D Gaussian maps that keep themselves up to date."""

from importlib.metadata import version

from gslts import losses
from gslts.adam import Adam, AdamOptions, AdamRates, AdamState
from gslts.camera import Camera, camera_from_fov, look_at
from gslts.gaussian_map import GaussianMap
from gslts.ply import read_ply, write_ply
from gslts.render import (
    Gradients,
    Images,
    LiftedFeatures,
    Rasterizer,
    RenderOptions,
    render,
)

__version__ = version("gslts")

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
