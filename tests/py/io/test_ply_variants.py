"""PLY files as other programs write them; the test makes each from the program's layout."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import plyfile
import pytest
import scenes
from compressed_ply import write_compressed_ply
from gaussian_shapes import assert_same_gaussians
from ply_maps import columns_of, float_map
from written_maps import assert_same

import gslts
from gslts.core.gaussian_map import SH_C0

XYZ, NORMALS = ["x", "y", "z"], ["nx", "ny", "nz"]
DC = [f"f_dc_{i}" for i in range(3)]
SCALES, ROTATIONS = [f"scale_{i}" for i in range(3)], [f"rot_{i}" for i in range(4)]


def rest(degree: int) -> list[str]:
    return [f"f_rest_{i}" for i in range(3 * (degree + 1) ** 2 - 3)]


def write(path: Path, columns: dict[str, Any], names: list[str], **options: Any) -> None:
    types = [(name, columns[name].dtype) for name in names]
    rows = np.empty(len(columns[names[0]]), types)
    for name in names:
        rows[name] = columns[name]
    elements = [plyfile.PlyElement.describe(rows, "vertex"), *options.pop("more", [])]
    plyfile.PlyData(elements, **options).write(path)


LAYOUTS = {
    # Inria, and the programs that follow it: Scaniverse, Polycam, Postshot, Luma.
    "inria": (3, [*XYZ, *NORMALS, *DC, *rest(3), "opacity", *SCALES, *ROTATIONS]),
    "gsplat": (3, [*XYZ, *DC, *rest(3), "opacity", *SCALES, *ROTATIONS]),
    "nerfstudio": (2, [*XYZ, *NORMALS, *DC, *rest(2), "opacity", *SCALES, *ROTATIONS]),
    "brush": (1, [*XYZ, *SCALES, "opacity", *ROTATIONS, *DC, *rest(1)]),
    "supersplat": (0, [*XYZ, *DC, "opacity", *ROTATIONS, *SCALES]),
    "spz_to_ply": (1, [*XYZ, *SCALES, *DC, "opacity", *ROTATIONS, *rest(1)]),
}


@pytest.mark.parametrize("options", [{"text": True}, {"byte_order": "<"}, {"byte_order": ">"}])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts(tmp_path: Path, layout: str, options: dict[str, Any], caplog: Any) -> None:
    degree, names = LAYOUTS[layout]
    gaussian_map = float_map(300, sh_degree=degree)
    write(tmp_path / "a.ply", columns_of(gaussian_map), names, **options)
    assert_same(gslts.read_ply(tmp_path / "a.ply"), gaussian_map)
    assert not caplog.records


def test_double_precision(tmp_path: Path) -> None:
    degree, names = LAYOUTS["inria"]
    gaussian_map = float_map(50, sh_degree=degree)
    columns = {name: column.astype(">f8") for name, column in columns_of(gaussian_map).items()}
    write(tmp_path / "a.ply", columns, names, byte_order=">")
    assert_same(gslts.read_ply(tmp_path / "a.ply"), gaussian_map)


def test_double_precision_far_out(tmp_path: Path) -> None:
    """A survey in UTM coordinates keeps its millimetres."""
    degree, names = LAYOUTS["inria"]
    gaussian_map = float_map(50, sh_degree=degree)
    columns: dict[str, Any] = columns_of(gaussian_map)
    center = np.array([500_000.25, 5_400_000.5, -120.0])
    exact = center + np.random.default_rng(0).normal(size=(50, 3))
    columns |= dict(zip(XYZ, exact.T, strict=True))
    write(tmp_path / "a.ply", columns, names)
    read = gslts.read_ply(tmp_path / "a.ply")
    np.testing.assert_array_equal(read.origin, np.round(read.origin))
    np.testing.assert_allclose(read.means + read.origin, exact, rtol=0, atol=1e-6)
    gslts.write_ply(read, tmp_path / "b.ply")
    assert_same(gslts.read_ply(tmp_path / "b.ply"), read)


def test_colours_of_8_bits(tmp_path: Path, caplog: Any) -> None:
    """`ns-export gaussian-splat --ply-color-mode rgb` of Nerfstudio."""
    gaussian_map = float_map(50)
    columns: dict[str, Any] = columns_of(gaussian_map)
    rng = np.random.default_rng(0)
    columns |= {name: rng.integers(0, 256, 50, np.uint8) for name in ("red", "green", "blue")}
    names = [*XYZ, *NORMALS, "red", "green", "blue", "opacity", *SCALES, *ROTATIONS]
    write(tmp_path / "a.ply", columns, names)
    read = gslts.read_ply(tmp_path / "a.ply")
    for i, name in enumerate(("red", "green", "blue")):
        np.testing.assert_allclose(0.5 + SH_C0 * read.sh[:, 0, i], columns[name] / 255, atol=1e-6)
    assert read.means.tobytes() == gaussian_map.means.tobytes()
    assert not caplog.records
    # Beside coefficients they are another property to ignore.
    write(tmp_path / "b.ply", columns, [*names, *DC])
    assert_same(gslts.read_ply(tmp_path / "b.ply"), gaussian_map)
    assert "ignored properties of vertex: red, green, blue" in caplog.text


def test_infinite_opacities_and_flat_gaussians(tmp_path: Path) -> None:
    """Programs compute the logit of 1 and the logarithm of 0."""
    gaussian_map = float_map(3)
    columns = {name: column.copy() for name, column in columns_of(gaussian_map).items()}
    columns["opacity"][:] = [np.inf, -np.inf, 2]
    columns["scale_2"][:] = [-np.inf, 1, 2]
    for kind in ("f4", "f8"):
        typed = {name: column.astype(kind) for name, column in columns.items()}
        write(tmp_path / "a.ply", typed, LAYOUTS["supersplat"][1])
        read = gslts.read_ply(tmp_path / "a.ply")
        assert read.logit_opacities.tolist() == [20, -20, 2]
        assert read.log_scales[:, 2].tolist() == [-30, 1, 2]
        rendered = gslts.render(read, scenes.orbit_camera())
        assert np.isfinite(rendered.rgb).all()


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("opacity", np.nan, "vertex 1: opacity: expected a finite float, got nan"),
        ("scale_0", np.inf, "vertex 1: scale_0: expected a finite float, got inf"),
        ("x", np.inf, "vertex 1: x: expected a finite float, got inf"),
    ],
)
def test_numbers_without_a_meaning(tmp_path: Path, column: str, value: float, message: str) -> None:
    columns = {name: array.copy() for name, array in columns_of(float_map(3)).items()}
    columns[column][1] = value
    write(tmp_path / "a.ply", columns, LAYOUTS["supersplat"][1])
    with pytest.raises(ValueError, match=re.escape(f"{tmp_path / 'a.ply'}: {message}")):
        gslts.read_ply(tmp_path / "a.ply")


def test_surfels_of_2dgs(tmp_path: Path) -> None:
    names = [name for name in LAYOUTS["inria"][1] if name != "scale_2"]
    write(tmp_path / "a.ply", columns_of(float_map(3, sh_degree=3)), names)
    with pytest.raises(ValueError, match="lacks property 'scale_2': 2D Gaussians; only 3D ones"):
        gslts.read_ply(tmp_path / "a.ply")


def test_a_point_cloud(tmp_path: Path) -> None:
    columns: dict[str, Any] = columns_of(float_map(3))
    columns |= {name: np.zeros(3, np.uint8) for name in ("red", "green", "blue")}
    write(tmp_path / "a.ply", columns, [*XYZ, *NORMALS, "red", "green", "blue"])
    with pytest.raises(ValueError, match="element 'vertex' lacks property 'opacity'"):
        gslts.read_ply(tmp_path / "a.ply")


def test_properties_and_elements_of_other_methods(tmp_path: Path, caplog: Any) -> None:
    """Such as the filter of Mip-Splatting, and cameras."""
    gaussian_map = float_map(5)
    columns: dict[str, Any] = {**columns_of(gaussian_map), "filter_3D": np.zeros(5, np.float32)}
    extrinsic = np.zeros(16, [("extrinsic", "f4")])
    more = [plyfile.PlyElement.describe(extrinsic, "extrinsic")]
    names = [*LAYOUTS["supersplat"][1], "filter_3D"]
    write(tmp_path / "a.ply", columns, names, more=more, comments=["made by hand"])
    assert_same(gslts.read_ply(tmp_path / "a.ply"), gaussian_map)
    assert "ignored properties of vertex: filter_3D" in caplog.text


@pytest.mark.parametrize("colors", [False, True])
@pytest.mark.parametrize("sh_degree", [0, 1, 2, 3])
@pytest.mark.parametrize("size", [1, 256, 700])
def test_compressed(tmp_path: Path, size: int, sh_degree: int, colors: bool) -> None:
    gaussian_map = float_map(size, sh_degree=sh_degree)
    gaussian_map = gslts.GaussianMap(
        means=gaussian_map.means,
        quats=gaussian_map.quats,
        log_scales=gaussian_map.log_scales,
        logit_opacities=gaussian_map.logit_opacities,
        sh=gaussian_map.sh.clip(-1.7, 1.7),
    )
    write_compressed_ply(gaussian_map, tmp_path / "a.ply", colors)
    assert_same_gaussians(
        gslts.read_ply(tmp_path / "a.ply"),
        gaussian_map,
        mean_m=0.52 * np.ptp(gaussian_map.means, axis=0).max() / 1023 + 1e-6,
        covariance=0.02,
        sh=8 / 256,
        color=0.51 / 255 / SH_C0,
        opacity=0.51 / 255,
    )
