"""Import of trimesh, which only glTF files need."""

from __future__ import annotations

from typing import Any


def import_trimesh() -> Any:
    """Import trimesh.

    Raises:
        ImportError: trimesh is missing.
    """
    try:
        import trimesh
    except ImportError as error:
        raise ImportError("glTF files need trimesh: pip install 'gslts[sim]'") from error
    return trimesh
