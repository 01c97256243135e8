"""Import of Open3D, which only the estimation of poses needs."""

from __future__ import annotations

from typing import Any


def import_open3d() -> Any:
    """Import Open3D.

    Raises:
        ImportError: It is missing.
    """
    try:
        import open3d
    except ImportError as error:
        raise ImportError("estimated poses need Open3D: pip install 'gslts[poses]'") from error
    return open3d
