"""Maps of fewer, larger Gaussians for coarse images."""

import change_room
import numpy as np
import pytest
from shared import viewpoints_all_around

from gslts._core.map import GaussianViewFloat
from gslts._core.raster import RasterizerFloat, RenderOptions
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.localization.coarse_maps import CoarseMaps, thin
from gslts.localization.image_pyramid import ImagePyramid


def volume(gaussian_map: GaussianMap) -> float:
    return float(np.exp(gaussian_map.log_scales.astype(np.float64).sum(axis=1)).sum())


def test_fewer_gaussians_fill_about_the_same_volume() -> None:
    gaussian_map = change_room.mapped()[0]
    few = thin(gaussian_map, 4)
    assert few.size == pytest.approx(gaussian_map.size / 4, rel=0.1)
    assert few.sh_degree == 0
    assert np.isin(few.means[:, 0], gaussian_map.means[:, 0]).all()
    assert volume(few) == pytest.approx(volume(gaussian_map), rel=0.15)


def test_a_coarse_image_of_fewer_gaussians_is_about_the_same() -> None:
    gaussian_map = change_room.mapped()[0]
    viewpoint = viewpoints_all_around("change_room", change_room.home(), 9)[0]
    frame = change_room.see(change_room.home(), viewpoint).halved()
    maps = CoarseMaps(gaussian_map)

    def rendered(view: GaussianViewFloat) -> np.ndarray:
        images = RasterizerFloat().forward(
            view, camera=frame.camera, options=RenderOptions(), mask=None
        )
        return images["rgb"]

    full = rendered(maps.for_level(0))
    off = np.abs(rendered(maps.for_level(1)) - full)
    assert 0 < off.mean() < 0.05
    smaller = np.abs(rendered(_not_grown(gaussian_map)) - full)
    assert off.mean() < 0.8 * smaller.mean()


def _not_grown(gaussian_map: GaussianMap) -> GaussianViewFloat:
    kept = np.isin(gaussian_map.means[:, 0], thin(gaussian_map, 2).means[:, 0])
    view = gaussian_map.select(kept).view()
    assert isinstance(view, GaussianViewFloat)
    return view


def test_a_full_image_is_compared_with_the_full_map() -> None:
    gaussian_map = change_room.mapped()[0]
    assert thin(gaussian_map, 1) is gaussian_map


def test_a_large_image_is_compared_in_spread_blocks() -> None:
    camera = Camera(
        fx=500, fy=500, cx=320, cy=240, width=640, height=480, world_from_camera=np.eye(4)
    )
    frame = RgbdFrame(np.zeros((480, 640, 3), np.uint8), np.ones((480, 640), np.float32), camera)
    large = ImagePyramid.of(frame)
    full = large.used_pixels(0)
    assert full.shape == (480, 640)
    assert full.mean() == pytest.approx(0.25, abs=0.05)
    assert full[:32, :32].all()
    assert not full[:32, 32:64].any()
    assert large.used_pixels(1).all()
