"""Detection behind a door that opened: what an update draws there is no evidence of changes."""

from dataclasses import replace

import numpy as np
import pytest

from gslts.change.config import DetectionConfig
from gslts.change.detector import ChangeDetector
from gslts.change.unknown import surface_fault
from gslts.core.camera import Camera, TrainingCamera, at_pose, camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import render

CONFIG = DetectionConfig(halvings=0, align_pose=False, threads=1)
WALL_Y_M, BEHIND_Y_M, HAZE_Y_M = 2.0, 3.5, 2.8
SPACING_M = 0.03
DOOR_HALF_M = 0.5


def panel(y_m: float, low: tuple[float, float], high: tuple[float, float]) -> GaussianMap:
    """Return opaque flat Gaussians in a plane, with squares of random colours."""
    x, z = np.meshgrid(*(np.arange(*ends, SPACING_M) for ends in zip(low, high, strict=True)))
    means = np.stack([x.ravel(), np.full(x.size, y_m), z.ravel()], axis=1)
    squares = np.random.default_rng(int(10 * y_m)).uniform(-1.5, 1.5, (60, 60, 3))
    rows, columns = (np.floor(4 * values.ravel()).astype(int) % 60 for values in (z, x))
    return GaussianMap(
        means=means.astype(np.float32),
        quats=np.tile(np.float32([1, 0, 0, 0]), (x.size, 1)),
        log_scales=np.tile(np.log(np.float32([SPACING_M, 0.002, SPACING_M])), (x.size, 1)),
        logit_opacities=np.full(x.size, 6, np.float32),
        sh=squares[rows, columns][:, None].astype(np.float32),
    )


def join(*parts: GaussianMap) -> GaussianMap:
    """Return all Gaussians, with rising ids."""
    names = ("means", "quats", "log_scales", "logit_opacities", "sh")
    return GaussianMap(
        **{name: np.concatenate([getattr(p, name) for p in parts]) for name in names}
    )


def wall_with_door() -> GaussianMap:
    """Return a wall with an open door."""
    wall = panel(WALL_Y_M, (-3.0, -0.5), (3.0, 2.5))
    x, _, z = wall.means.T
    return join(wall.select((np.abs(x) > DOOR_HALF_M) | (z > 2)))


def cameras() -> list[Camera]:
    """Return cameras before the wall, all around the door."""
    camera = camera_from_fov(160, 120, 1.4)
    positions = [np.array([x, y, 1.0]) for x in np.linspace(-1, 1, 6) for y in (-0.4, 0.0)]
    return [at_pose(camera, look_at(p, np.array([0.0, WALL_Y_M, 1.0]))) for p in positions]


OLD, BEHIND = wall_with_door(), panel(BEHIND_Y_M, (-3.0, -1.0), (3.0, 3.0))
HAZE = panel(HAZE_Y_M, (-0.4, 0.6), (0.2, 1.4))
MAP = join(OLD, BEHIND, HAZE)
"""With a piece of haze behind the door, that does not exist."""
NEXT_ID = OLD.size
"""Greater than the ids of the map when the door was closed."""


def frame() -> RgbdFrame:
    """Return a frame that looks through the door."""
    camera = cameras()[5]
    images = render(join(OLD, BEHIND), camera)
    colors = np.rint(255 * images.rgb.clip(0, 1)).astype(np.uint8)
    return RgbdFrame(colors, images.depth.astype(np.float32), camera)


@pytest.mark.parametrize("last_id", [MAP.size, NEXT_ID], ids=["door open", "door closed"])
def test_only_cameras_that_saw_through_the_door_vouch_for_what_is_behind(last_id: int) -> None:
    seen_from = [TrainingCamera(camera, last_id) for camera in cameras()]
    found = ChangeDetector(MAP, CONFIG, cameras=seen_from).detect(frame())
    assert found.unreliable is None
    if last_id == MAP.size:
        (change,) = found.changes
        assert change.kind == "removal"
        assert change.point[1] == pytest.approx(HAZE_Y_M, abs=0.05)
    else:
        assert found.changes == ()
        faults = {surface_fault(surface) for surface in found.surfaces}
        assert faults == {"too few training cameras saw this position"}


def test_what_a_single_camera_saw_cannot_be_judged_in_a_map_of_many() -> None:
    seen_from = [TrainingCamera(camera, NEXT_ID) for camera in cameras()]
    late = TrainingCamera(cameras()[5], MAP.size)
    few = ChangeDetector(MAP, CONFIG, cameras=[*seen_from, late]).detect(frame())
    many = ChangeDetector(MAP, CONFIG, cameras=[*(5 * seen_from), late]).detect(frame())
    assert len(few.changes) == 1
    assert many.changes == ()


def test_a_removed_object_before_the_door_is_still_found() -> None:
    box = replace(HAZE, means=HAZE.means - np.float32([0, HAZE_Y_M - 1.5, 0]))
    seen_from = [TrainingCamera(camera, NEXT_ID) for camera in cameras()]
    found = ChangeDetector(join(OLD, BEHIND, box), CONFIG, cameras=seen_from).detect(frame())
    (change,) = found.changes
    assert change.kind == "removal"
    assert change.point[1] == pytest.approx(1.5, abs=0.05)
