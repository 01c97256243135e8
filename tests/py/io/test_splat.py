""".splat files as another program decodes them."""

import struct
from pathlib import Path

import numpy as np
import pytest
import scenes
from splat_files import ORIGIN, decoded

import gslts
from gslts.core.gaussian_map import SH_C0
from gslts.io.splat import write_splat


def test_a_viewer_shows_the_same(tmp_path: Path) -> None:
    """Also turned Gaussians and a map with an origin, to the precision of eight bits."""
    gaussian_map = scenes.random_map(200, origin=ORIGIN)
    # Colours that the format can hold, so that none is clipped.
    gaussian_map = gslts.GaussianMap(
        means=gaussian_map.means,
        quats=gaussian_map.quats,
        log_scales=gaussian_map.log_scales,
        logit_opacities=gaussian_map.logit_opacities.clip(-4, 4),
        sh=gaussian_map.sh.clip(-1.7, 1.7),
        origin=gaussian_map.origin,
    )
    write_splat(gaussian_map, tmp_path / "a.splat")
    camera = scenes.orbit_camera(160, 120, target=ORIGIN)
    expected = gslts.render(gaussian_map, camera).rgb
    assert np.ptp(expected) > 0.5
    rgb = gslts.render(decoded(tmp_path / "a.splat"), camera).rgb
    assert np.abs(rgb - expected).max() < 0.03
    assert np.abs(rgb - expected).mean() < 0.002


def test_every_byte_of_one_gaussian(tmp_path: Path) -> None:
    gaussian = scenes.single_gaussian(
        np.float32,
        means=[[1.0, 2.0, 3.0]],
        quats=[[0.0, 2.0, 0.0, 0.0]],
        log_scales=np.log([[0.1, 0.2, 0.3]]),
        logit_opacities=[np.log(3.0)],  # Opacity 0.75.
        sh=[[[0.25 / SH_C0, -9, 9]]],
    )
    write_splat(gaussian, tmp_path / "one.splat")
    values = struct.unpack("<6f8B", (tmp_path / "one.splat").read_bytes())
    assert values[:6] == pytest.approx((1, 2, 3, 0.1, 0.2, 0.3))
    assert values[6:] == (191, 0, 255, 191, 128, 255, 128, 128)


def test_no_rotation_and_no_gaussians(tmp_path: Path) -> None:
    write_splat(scenes.single_gaussian(quats=np.zeros((1, 4))), tmp_path / "one.splat")
    assert (tmp_path / "one.splat").read_bytes()[28:] == bytes([255, 128, 128, 128])
    write_splat(scenes.random_map(0), tmp_path / "none.splat")
    assert (tmp_path / "none.splat").read_bytes() == b""


def test_the_most_important_come_first(tmp_path: Path) -> None:
    write_splat(scenes.random_map(300), tmp_path / "a.splat")
    read = decoded(tmp_path / "a.splat")
    importance = np.exp(read.log_scales.sum(axis=1)) / (1 + np.exp(-read.logit_opacities))
    # Opacities are rounded to 1/255, so neighbours may change places.
    assert (importance[10:] < 1.1 * importance[:-10]).all()
    assert importance[:100].min() > importance[200:].max()
