"""Import of Open3D, which only the estimation of poses needs."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

MISSING = "estimated poses need Open3D: pip install 'gslts[poses]'"
"""Message if it is missing."""


def require_open3d() -> None:
    """Check that Open3D is installed; importing it takes seconds.

    Raises:
        ImportError: It is missing.
    """
    if find_spec("open3d") is None:
        raise ImportError(MISSING)


def import_open3d() -> Any:
    """Import Open3D.

    Raises:
        ImportError: It is missing, or lacks a library of the system.
    """
    try:
        import open3d
    except ModuleNotFoundError as error:
        raise ImportError(MISSING) from error
    return open3d
