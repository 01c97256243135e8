"""Maps in .glb files: own round trips, and files of other programs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from gaussian_shapes import assert_same_gaussians
from hypothesis import given
from ply_maps import float_map
from splat_glb import EXTENSION, SplatGlb
from written_maps import assert_same, maps

import gslts
from gslts.core.se3 import rotation_of_quat
from gslts.core.similarity import transform_map
from gslts.io.gltf_file import Z_UP
from gslts.io.gltf_read import read_glb
from gslts.io.gltf_write import write_glb


@given(gaussians=maps(min_size=1))
def test_round_trip_keeps_every_bit(tmp_path_factory: Any, gaussians: gslts.GaussianMap) -> None:
    path = tmp_path_factory.getbasetemp() / "round_trip.glb"
    write_glb(gaussians, path)
    assert_same(read_glb(path), gaussians)


@pytest.mark.parametrize("sh_degree", [0, 1, 2, 3])
def test_round_trip_of_a_large_map(tmp_path: Path, sh_degree: int) -> None:
    gaussians = float_map(3000, sh_degree=sh_degree, feature_dims=4, origin=(1e6, -2, 0.1))
    gaussians = gaussians.select(np.arange(2999, 0, -2))
    write_glb(gaussians, tmp_path / "map.glb", {"version": 3})
    assert_same(read_glb(tmp_path / "map.glb"), gaussians)


def test_two_gaussians_of_another_program(tmp_path: Path) -> None:
    """In glTF y points up; in the map z does: (x, y, z) becomes (x, -z, y)."""
    read = read_glb(SplatGlb(4).write(tmp_path / "a.glb"))
    np.testing.assert_allclose(read.means, [[1, -3, 2], [-4, 6, 5]])
    np.testing.assert_allclose(np.exp(read.log_scales), [[0.1, 0.2, 0.3], [1, 2, 3]], rtol=1e-6)
    np.testing.assert_allclose(read.logit_opacities, [np.log(1 / 3), 0], atol=1e-7)
    turns = [rotation_of_quat(quat) for quat in read.quats]
    np.testing.assert_allclose(turns[0], Z_UP[:3, :3], atol=1e-6)
    np.testing.assert_allclose(turns[1], Z_UP[:3, :3] @ Z_UP[:3, :3], atol=1e-6)
    np.testing.assert_allclose(read.sh[:, 0], [[0, 1, 2], [3, 4, 5]])
    # Degree 1 is -y, z, -x: up in the file, y, is z in the map.
    np.testing.assert_allclose(read.sh[0, 1:], [[2, 1, 2], [-1, -1, -2], [3, 1, 2]], atol=1e-6)
    assert read.ids.tolist() == [0, 1]
    assert read.origin.tolist() == [0, 0, 0]


def test_the_transform_of_the_nodes_is_applied(tmp_path: Path) -> None:
    plain = read_glb(SplatGlb(4).write(tmp_path / "plain.glb"))
    file = SplatGlb(4)
    file.tree["scenes"] = [{"nodes": [1]}]
    file.tree["nodes"] = [
        {"mesh": 0, "translation": [1, 2, 3]},
        {"children": [0], "rotation": [0, 0.6, 0, 0.8], "scale": [2, 2, 2]},
    ]
    read = read_glb(file.write(tmp_path / "a.glb"))
    outer, inner = np.eye(4), np.eye(4)
    outer[:3, :3] = 2 * rotation_of_quat(np.array([0.8, 0, 0.6, 0]))
    inner[:3, 3] = [1, 2, 3]
    expected = transform_map(plain, Z_UP @ outer @ inner @ Z_UP.T)
    assert_same_gaussians(read, expected, 1e-5, 1e-5, 1e-5, 1e-6, 1e-6)


def test_quantized_numbers(tmp_path: Path) -> None:
    file = SplatGlb()
    file.add(f"{EXTENSION}:ROTATION", [[0, 0, 0, 127], [90, 0, 0, 90]], np.int8, normalized=True)
    file.add(f"{EXTENSION}:OPACITY", [[64 * 257], [65535]], np.uint16, normalized=True)
    file.add(f"{EXTENSION}:SCALE", [[1, 2, 3], [0, 1, 1]], np.int8)
    # Rows of 1 and 3 bytes begin at multiples of 4.
    file.tree["extensionsRequired"] = [EXTENSION, "KHR_mesh_quantization"]
    read = read_glb(file.write(tmp_path / "a.glb"))
    opacities = 1 / (1 + np.exp(-read.logit_opacities.astype(np.float64)))
    np.testing.assert_allclose(opacities, [64 / 255, 1], atol=1e-7)
    np.testing.assert_allclose(np.exp(read.log_scales[0]), [1, 2, 3], rtol=1e-6)
    assert read.log_scales[1].tolist() == [-30, 0, 0]


def test_what_another_program_changed_counts(tmp_path: Path) -> None:
    """It does not know of the attributes that hold what the map stored."""
    gaussians = float_map(4, sh_degree=1)
    file = SplatGlb()
    for name, rows in (
        ("POSITION", gaussians.means),
        ("_LOG_SCALE", gaussians.log_scales),
        ("_ROTATION", np.roll(gaussians.quats, -1, axis=1)),
        ("_LOGIT_OPACITY", gaussians.logit_opacities[:, None]),
        (f"{EXTENSION}:SCALE", 2 * np.exp(gaussians.log_scales)),
        (f"{EXTENSION}:ROTATION", [[0, 0, 0, 1]] * 4),
        (f"{EXTENSION}:OPACITY", [[0.5]] * 4),
        (f"{EXTENSION}:SH_DEGREE_0_COEF_0", gaussians.sh[:, 0]),
    ):
        file.add(name, rows)
    file.tree["nodes"][0]["matrix"] = Z_UP.ravel().tolist()  # By columns: its inverse.
    read = read_glb(file.write(tmp_path / "a.glb"))
    np.testing.assert_allclose(read.log_scales, gaussians.log_scales + np.log(2), atol=1e-6)
    assert read.quats.tolist() == [[1, 0, 0, 0]] * 4
    assert not read.logit_opacities.any()


def test_what_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"float64.*gaussian_map\.astype\(np\.float32\)"):
        write_glb(scenes.random_map(3), tmp_path / "map.glb")
    with pytest.raises(ValueError, match=r"map\.glb: the map has no Gaussians"):
        write_glb(float_map(0), tmp_path / "map.glb")
    assert list(tmp_path.iterdir()) == []
