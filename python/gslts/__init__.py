"""Photorealistic, semantic 3D Gaussian maps that robots keep up to date by themselves."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gslts.change.detector import ChangeDetector
    from gslts.change.monitor import ChangeMonitor
    from gslts.consolidation.pipeline import consolidate_map
    from gslts.core.camera import Camera, camera_from_fov, look_at
    from gslts.core.frame import RgbdFrame
    from gslts.core.gaussian_map import GaussianMap
    from gslts.core.robot import Robot
    from gslts.datasets.registry import open_dataset
    from gslts.extension.pipeline import extend_map
    from gslts.io.ply import read_ply, write_ply
    from gslts.keeper.keeper import MapKeeper
    from gslts.localization.relocalizer import Relocalizer
    from gslts.mapping.config import MappingConfig
    from gslts.mapping.engine import make_map
    from gslts.navigation.navigator import Navigator
    from gslts.rendering import losses
    from gslts.rendering.adam import Adam, AdamRates
    from gslts.rendering.rasterizer import Rasterizer, RenderOptions, render
    from gslts.semantics.queries import SemanticQueries
    from gslts.store.map_folder import open_map, read_map
    from gslts.store.map_store import MapStore
    from gslts.update.pipeline import update_map

    __version__: str

__all__ = [
    "Adam",
    "AdamRates",
    "Camera",
    "ChangeDetector",
    "ChangeMonitor",
    "GaussianMap",
    "MapKeeper",
    "MapStore",
    "MappingConfig",
    "Navigator",
    "Rasterizer",
    "Relocalizer",
    "RenderOptions",
    "RgbdFrame",
    "Robot",
    "SemanticQueries",
    "__version__",
    "camera_from_fov",
    "consolidate_map",
    "extend_map",
    "look_at",
    "losses",
    "make_map",
    "open_dataset",
    "open_map",
    "read_map",
    "read_ply",
    "render",
    "update_map",
    "write_ply",
]

# Imported at first use: `gslts --help` needs neither NumPy nor the extension.
_MODULE_OF = {
    "Adam": "gslts.rendering.adam",
    "AdamRates": "gslts.rendering.adam",
    "Camera": "gslts.core.camera",
    "ChangeDetector": "gslts.change.detector",
    "ChangeMonitor": "gslts.change.monitor",
    "GaussianMap": "gslts.core.gaussian_map",
    "MapKeeper": "gslts.keeper.keeper",
    "MapStore": "gslts.store.map_store",
    "MappingConfig": "gslts.mapping.config",
    "Navigator": "gslts.navigation.navigator",
    "Rasterizer": "gslts.rendering.rasterizer",
    "Relocalizer": "gslts.localization.relocalizer",
    "RenderOptions": "gslts.rendering.rasterizer",
    "RgbdFrame": "gslts.core.frame",
    "Robot": "gslts.core.robot",
    "SemanticQueries": "gslts.semantics.queries",
    "camera_from_fov": "gslts.core.camera",
    "consolidate_map": "gslts.consolidation.pipeline",
    "extend_map": "gslts.extension.pipeline",
    "look_at": "gslts.core.camera",
    "make_map": "gslts.mapping.engine",
    "open_dataset": "gslts.datasets.registry",
    "open_map": "gslts.store.map_folder",
    "read_map": "gslts.store.map_folder",
    "read_ply": "gslts.io.ply",
    "render": "gslts.rendering.rasterizer",
    "update_map": "gslts.update.pipeline",
    "write_ply": "gslts.io.ply",
}


def __getattr__(name: str) -> Any:
    """Import a public name and keep it (PEP 562).

    Raises:
        AttributeError: There is no such name.
    """
    value: Any
    if name == "__version__":
        from importlib.metadata import version

        value = version("gslts")
    elif name == "losses":
        value = import_module("gslts.rendering.losses")
    elif name in _MODULE_OF:
        import_module("gslts._cpu")  # An ImportError says what this processor lacks.
        value = getattr(import_module(_MODULE_OF[name]), name)
    else:
        raise AttributeError(f"module 'gslts' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
