"""A simulated room, a map of it, and what a robot sees after something was changed."""

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import sim_scenes
from shared import made_once, viewpoints_all_around

from gslts.change.config import DetectionConfig
from gslts.change.detector import ChangeDetector
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import open_dataset
from gslts.mapping.config import MappingConfig
from gslts.mapping.engine import make_map
from gslts.store.map_folder import camera_from_json, camera_to_json, read_map, write_map_folder
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.home import Home, HomeObject
from gslts_sim.robot_body import Viewpoint

TILES = 20
SIZE = {"width": 160, "height": 120}
CONFIG = DetectionConfig(halvings=0)
"""Images are small already."""
BLOCK_TOP_M = 0.75
VIEWPOINTS = (
    Viewpoint(2.5, 0.5, 90.0, 30.0),
    Viewpoint(2.75, 3.5, 270.0, 30.0),
    Viewpoint(1.5, 0.5, 60.0, 30.0),
)
"""At the block, so that nothing on it hides anything else there."""


def tiled(
    name: str,
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    seed: int,
    darkest: int,
    *,
    inward: bool = False,
    period: int = TILES,
) -> HomeObject:
    """A box with squares of 0.25 m of random colours, no two places of which look the same.

    With a smaller period, they repeat after so many.
    """
    rng = np.random.default_rng(seed)
    squares = rng.integers(darkest, 220, (period, period, 3)).astype(np.uint8)
    squares = np.tile(squares, (TILES // period, TILES // period, 1))
    texture = squares.repeat(16, 0).repeat(16, 1)
    box = sim_scenes.box_object(name, low, high, texture, inward=inward)
    (surface,) = box.surfaces
    return replace(box, surfaces=(replace(surface, uvs=surface.uvs / (0.25 * TILES)),))


def thing(name: str, x: float, y: float, texture: np.ndarray, parent: str) -> HomeObject:
    """A box of 0.24 x 0.24 x 0.3 m on the block or on the floor, its middle at a place."""
    z = BLOCK_TOP_M if parent == "Block|1" else 0.0
    low, high = (x - 0.12, y - 0.12, z), (x + 0.12, y + 0.12, z + 0.3)
    box = sim_scenes.box_object(name, low, high, texture)
    return replace(box, movable=True, parent=parent)


RED = np.full((4, 4, 3), (200, 40, 30), np.uint8)
BLUE = np.full((4, 4, 3), (30, 60, 200), np.uint8)
YELLOW = np.full((4, 4, 3), (230, 200, 30), np.uint8)


@cache
def home() -> Home:
    """A textured room with a red box and a blue one on a block."""
    plain = sim_scenes.simple_home()
    # The walls go on below the floor, or two surfaces would be in one place.
    walls = tiled("Wall|1", (0, 0, -0.2), (5, 4, 2.6), 0, 40, inward=True)
    walls = replace(walls, boxes=np.delete(walls.boxes, 4, axis=0))
    floor = tiled("Floor|1", (0, 0, -0.1), (5, 4, 0), 1, 90)
    block = tiled("Block|1", (2.0, 1.5, 0), (3.2, 2.3, 0.75), 2, 110)
    block = replace(block, receptacle=True, parent="Floor|1")
    red = thing("Box|1", 2.2, 1.85, RED, "Block|1")
    blue = thing("Box|2", 3.0, 1.95, BLUE, "Block|1")
    return replace(plain, objects=(walls, replace(floor, receptacle=True), block, red, blue))


def see(where: Home, viewpoint: Viewpoint, noise: str = "none", seed: int = 0) -> RgbdFrame:
    """Return the frame that a robot in a home observes from a viewpoint."""
    robot = Controller(where, **SIZE, noise=noise, seed=seed)
    robot.go(viewpoint)
    return robot.observe()


@cache
def mapped() -> tuple[GaussianMap, dict[str, Camera]]:
    """The map of the room, and the cameras of the frames that it was made from."""

    def make(folder: Path) -> None:
        viewpoints = [*viewpoints_all_around("change_room", home(), 48), *VIEWPOINTS]
        gaussian_map, cameras = map_of(home(), viewpoints)
        write_map_folder(folder, gaussian_map, {}, {})
        plain = {name: camera_to_json(camera) for name, camera in cameras.items()}
        (folder / "exact.json").write_text(json.dumps(plain))

    folder = made_once("change_room_map", make)
    # Cameras that are read with a map are made rigid, which changes their last bits.
    plain = json.loads((folder / "exact.json").read_text())
    return read_map(folder), {name: camera_from_json(camera) for name, camera in plain.items()}


def map_of(where: Home, viewpoints: Sequence[Viewpoint]) -> tuple[GaussianMap, dict[str, Camera]]:
    """A map that is made in some seconds, and the cameras of the frames."""
    config = MappingConfig(
        iterations=1000,
        patience=1.0,
        rough_epochs=0,
        voxel_m=0.03,
        coarse_share=0.3,
        variant_steps=0,
        refine_poses=False,
        refine_lenses=False,
    )
    with TemporaryDirectory() as folder:
        visit = Path(folder) / "visit"
        capture(Controller(where, **SIZE), viewpoints, visit)
        result = make_map(open_dataset(visit), config)
    cameras = {
        name: observation.camera()
        for name, observation in (result.training | result.held_out).items()
    }
    return result.gaussian_map, cameras


@cache
def detector() -> ChangeDetector:
    """Make a detector on the map, with the cameras that the map was made from."""
    gaussian_map, cameras = mapped()
    return ChangeDetector(gaussian_map, CONFIG, cameras=cameras.values())


def write_room_map(folder: Path) -> None:
    """The map as `gslts map` leaves it."""
    gaussian_map, cameras = mapped()
    write_map_folder(folder, gaussian_map, {}, cameras)
