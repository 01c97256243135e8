"""Files of Gaussians that gslts writes and other programs read, and those that they write.

The judges are splat-transform, whose SPZ code is the original one of Niantic, and three.js.
"""

from pathlib import Path

import numpy as np
import pytest
import scenes
from gaussian_shapes import assert_same_gaussians, covariances
from judges import needs_judges, splat_transform, three_reads
from ply_maps import float_map

import gslts
from gslts.core.gaussian_map import SH_C0
from gslts.core.similarity import transform_map
from gslts.io.gltf_file import Z_UP
from gslts.io.map_files import read_map_file, write_map_file

pytestmark = needs_judges

# splat-transform takes a PLY file as x right, y down, z forward.
SPZ_FROM_PLY = np.diag([1.0, -1, -1, 1])
GLB_FROM_PLY = np.diag([-1.0, -1, 1, 1])
SPZ = {"mean_m": 1.3e-4, "covariance": 0.07, "color": 0.015, "opacity": 0.002}
"""Errors of SPZ: half a step of each number. A step of a scale is 1/16, of its square 2/16."""
THEIR_SH, OUR_SH = 8.5 / 128, 2.5 / 128
"""Errors of harmonics beyond degree 0: splat-transform keeps 4 bits of them, gslts 6."""


def in_range(size: int, sh_degree: int) -> gslts.GaussianMap:
    """A map of which every number lies in the ranges of SPZ."""
    gaussian_map = float_map(size, sh_degree=sh_degree)
    return gslts.GaussianMap(
        means=gaussian_map.means,
        quats=gaussian_map.quats,
        log_scales=gaussian_map.log_scales,
        logit_opacities=gaussian_map.logit_opacities.clip(-5, 5),
        sh=gaussian_map.sh.clip(-0.3, 0.3),  # In range also when they are rotated.
    )


@pytest.fixture
def degree_3(tmp_path: Path) -> tuple[gslts.GaussianMap, Path]:
    gaussian_map = in_range(700, 3)
    gslts.write_ply(gaussian_map, tmp_path / "map.ply")
    return gaussian_map, tmp_path / "map.ply"


def test_our_ply_is_read_and_theirs_too(
    degree_3: tuple[gslts.GaussianMap, Path], tmp_path: Path
) -> None:
    gaussian_map, path = degree_3
    splat_transform(path, tmp_path / "back.ply")
    assert_same_gaussians(read_map_file(tmp_path / "back.ply"), gaussian_map, 0, 0, 0, 0, 0)


@pytest.mark.parametrize("version", [3, 4])
def test_their_spz_is_read(
    degree_3: tuple[gslts.GaussianMap, Path], tmp_path: Path, version: int
) -> None:
    gaussian_map, path = degree_3
    splat_transform(path, tmp_path / "a.spz", "--spz-version", str(version))
    expected = transform_map(gaussian_map, SPZ_FROM_PLY)
    in_file_axes = transform_map(read_map_file(tmp_path / "a.spz"), Z_UP.T)
    assert_same_gaussians(in_file_axes, expected, sh=THEIR_SH, **SPZ)


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("sh_degree", [0, 1, 2, 3])
def test_our_spz_is_read(tmp_path: Path, version: int, sh_degree: int) -> None:
    gaussian_map = in_range(500, sh_degree)
    write_map_file(gaussian_map, tmp_path / "a.spz", spz_version=version)
    splat_transform(tmp_path / "a.spz", tmp_path / "back.ply")
    in_file_axes = transform_map(gslts.read_ply(tmp_path / "back.ply"), SPZ_FROM_PLY)
    assert_same_gaussians(in_file_axes, transform_map(gaussian_map, Z_UP.T), sh=OUR_SH, **SPZ)
    own = read_map_file(tmp_path / "a.spz")
    assert_same_gaussians(transform_map(own, Z_UP.T), in_file_axes, 1e-6, 1e-5, 1e-5, 1e-5, 1e-5)


def test_their_glb_is_read(degree_3: tuple[gslts.GaussianMap, Path], tmp_path: Path) -> None:
    gaussian_map, path = degree_3
    splat_transform(path, tmp_path / "a.glb")
    expected = transform_map(gaussian_map, Z_UP @ GLB_FROM_PLY)
    assert_same_gaussians(read_map_file(tmp_path / "a.glb"), expected, 1e-6, 1e-5, 1e-5, 1e-6, 1e-6)


@pytest.mark.parametrize("sh_degree", [0, 1, 2, 3])
def test_our_glb_is_read(tmp_path: Path, sh_degree: int) -> None:
    origin = (3.0, -2.0, 0.5)
    gaussian_map = scenes.random_map(50, sh_degree=sh_degree, dtype=np.float32, origin=origin)
    about = {"version": 3, "objects": [{"name": "Mug", "box": None}]}
    write_map_file(gaussian_map, tmp_path / "a.glb", about)
    read = three_reads(tmp_path / "a.glb")
    assert read["count"] == 1
    assert read["extras"] == about
    scene_from_node = np.array(read["matrix"]).reshape(4, 4).T
    arrays = {name: np.array(values) for name, values in read["arrays"].items()}
    centers = arrays["position"].reshape(-1, 3) @ scene_from_node[:3, :3].T
    centers += scene_from_node[:3, 3]
    x, y, z = (gaussian_map.means + gaussian_map.origin).T
    np.testing.assert_allclose(centers, np.column_stack([x, z, -y]), atol=1e-6)
    rows, columns = np.triu_indices(3)
    expected = covariances(gaussian_map)[:, rows, columns]
    covariance = arrays["covariance"].reshape(-1, 6)
    np.testing.assert_allclose(covariance, expected, atol=1e-6 * expected.max())
    colors = 0.5 + SH_C0 * gaussian_map.sh[:, 0].astype(np.float64)
    opacities = 1 / (1 + np.exp(-gaussian_map.logit_opacities.astype(np.float64)))
    rgba = 255 * np.column_stack([colors, opacities]).clip(0, 1)
    assert np.abs(arrays["color"].reshape(-1, 4) - rgba).max() <= 1
    bands = [f"sphericalHarmonics{degree}" in arrays for degree in (1, 2, 3)]
    assert bands == [sh_degree >= degree for degree in (1, 2, 3)]


def test_their_compressed_ply_is_read(
    degree_3: tuple[gslts.GaussianMap, Path], tmp_path: Path
) -> None:
    _, path = degree_3
    splat_transform(path, tmp_path / "a.compressed.ply")
    splat_transform(tmp_path / "a.compressed.ply", tmp_path / "back.ply")
    read = read_map_file(tmp_path / "a.compressed.ply")
    assert_same_gaussians(read, read_map_file(tmp_path / "back.ply"), 1e-6, 1e-5, 1e-5, 1e-5, 1e-6)
