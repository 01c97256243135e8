"""Recordings from which maps are made, and settings of a short training."""

from pathlib import Path

import numpy as np
from shared import made_once
from sim_scenes import textured_home

from gslts.mapping.config import MappingConfig
from gslts.mapping.engine import MappingResult
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.explore import explore

# Images are 160 px wide: Gaussians of 5 cm are a few pixels wide there.
CONFIG = MappingConfig(
    iterations=500,
    patience=1.0,
    rough_epochs=5,
    voxel_m=0.05,
    coarse_share=0.3,
    variant_steps=0,
)
MAP_ARRAYS = ("means", "quats", "log_scales", "logit_opacities", "sh", "ids")


def record_room() -> dict[str, Path]:
    """Return recordings of a room with the errors of a real camera, and without, by noise."""
    folder = made_once("map_recordings", _record)
    return {noise: folder / noise for noise in ("kinect", "none")}


def _record(folder: Path) -> None:
    folder.mkdir()
    home = textured_home()
    viewpoints, _ = explore(home, 60)
    for noise in ("kinect", "none"):
        capture(Controller(home, width=160, height=120, noise=noise), viewpoints, folder / noise)


def require_same(first: MappingResult, second: MappingResult) -> None:
    for name in MAP_ARRAYS:
        array, other = (getattr(result.gaussian_map, name) for result in (first, second))
        assert array.tobytes() == other.tobytes(), name
    for frame, other in zip(first.training.values(), second.training.values(), strict=True):
        np.testing.assert_array_equal(frame.world_from_camera, other.world_from_camera)
        assert frame.lenses == other.lenses
