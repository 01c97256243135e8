"""Navigation needs maps with z up."""

from __future__ import annotations

from pathlib import Path

from gslts.store.camera_files import cameras_of_map
from gslts.trajectory.upright import describe_tilt


def require_upright(path: Path) -> None:
    """Reject a map folder in whose world z is not up, by its training cameras.

    Args:
        path: Of a map; a file of another program has no cameras, and passes.

    Raises:
        OSError: A file cannot be read.
        ValueError: Z is not up.
    """
    if tilt := describe_tilt(list(cameras_of_map(path).values())):
        raise ValueError(
            f"{path}: {tilt}; navigation needs z up: make the map with gslts map --poses upright"
        )
