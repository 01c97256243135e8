"""Active Scene Updater: keeps a map up to date with object changes (GS-LTS, sec. III-D)."""

from gslts.update.config import (
    GS_LTS,
    CollectConfig,
    EditConfig,
    RefineConfig,
    UpdateConfig,
)
from gslts.update.integrate import UpdateResult, integrate_changes
from gslts.update.pipeline import MapUpdate, update_map

__all__ = [
    "GS_LTS",
    "CollectConfig",
    "EditConfig",
    "MapUpdate",
    "RefineConfig",
    "UpdateConfig",
    "UpdateResult",
    "integrate_changes",
    "update_map",
]
