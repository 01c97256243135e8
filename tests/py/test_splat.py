"""Export: .splat as another program decodes it, and PLY files of and for other programs."""

import struct
from pathlib import Path

import numpy as np
import pytest
import scenes
from command import gslts as run
from plyfile import PlyData

import gslts
from gslts.gaussian_map import SH_C0
from gslts.map_folder import read_map, write_map_folder
from gslts.splat import write_splat

ORIGIN = (3.0, -2.0, 0.5)


def decoded(path: Path) -> gslts.GaussianMap:
    """What a viewer makes of the file, byte by byte, as its inventor's page describes it."""
    content = path.read_bytes()
    rows = [struct.unpack_from("<6f8B", content, at) for at in range(0, len(content), 32)]
    assert len(content) == 32 * len(rows)
    values = np.array(rows)
    opacities = (values[:, 9] / 255).clip(1e-3, 1 - 1e-3)
    return gslts.GaussianMap(
        means=values[:, 0:3],
        quats=(values[:, 10:14] - 128) / 128,
        log_scales=np.log(values[:, 3:6]),
        logit_opacities=np.log(opacities / (1 - opacities)),
        sh=((values[:, 6:9] / 255 - 0.5) / SH_C0)[:, None],
    )


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
    one = scenes.single_gaussian(
        np.float32,
        means=[[1.0, 2.0, 3.0]],
        quats=[[0.0, 2.0, 0.0, 0.0]],
        log_scales=np.log([[0.1, 0.2, 0.3]]),
        logit_opacities=[np.log(3.0)],  # Opacity 0.75.
        sh=[[[0.25 / SH_C0, -9, 9]]],
    )
    write_splat(one, tmp_path / "one.splat")
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


def test_export_command(tmp_path: Path) -> None:
    gaussian_map = scenes.random_map(30, sh_degree=2, dtype=np.float32, origin=ORIGIN)
    write_map_folder(tmp_path / "map", gaussian_map, {}, {})
    done = run("export", "map", "a.ply", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    vertex = PlyData.read(tmp_path / "a.ply")["vertex"]
    np.testing.assert_array_equal(vertex["opacity"], gaussian_map.logit_opacities)
    back = read_map(tmp_path / "a.ply")
    assert back.sh.tobytes() == gaussian_map.sh.tobytes()
    assert tuple(back.origin) == ORIGIN
    done = run("export", "a.ply", "new/b.splat", cwd=tmp_path)  # A plain file is a map too.
    assert done.returncode == 0, done.stderr
    assert "30 Gaussians, 960 bytes" in done.stdout
    assert "SH degree 0, degrees to 2 do not fit" in done.stdout
    np.testing.assert_allclose(
        np.sort(decoded(tmp_path / "new/b.splat").means[:, 0]),
        np.sort(gaussian_map.means[:, 0] + ORIGIN[0]),
        rtol=1e-6,
    )
    assert "rounded" not in done.stdout


def test_rounded_centres_are_told(tmp_path: Path) -> None:
    far = scenes.random_map(9, dtype=np.float32, origin=(0.0, 5_432_109.5, 0.0))
    write_map_folder(tmp_path / "map", far, {}, {})
    done = run("export", "map", "a.splat", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "rounded by up to 250 mm" in done.stdout
    written = np.sort(decoded(tmp_path / "a.splat").means[:, 1])
    assert np.abs(written - np.sort(far.means[:, 1]) - far.origin[1]).max() <= 0.25


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("map", "a.obj"), "gslts: a.obj: must end in .ply or .splat"),
        (("map", "there.ply"), "gslts: there.ply is there already"),
        (("gone", "a.ply"), "gone"),
        (("there.ply", "a.splat"), "there.ply"),
    ],
)
def test_what_cannot_be_exported(tmp_path: Path, arguments: tuple[str, str], message: str) -> None:
    write_map_folder(tmp_path / "map", scenes.random_map(3, dtype=np.float32), {}, {})
    (tmp_path / "there.ply").write_text("no map")
    done = run("export", *arguments, cwd=tmp_path)
    assert done.returncode == 1
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert (tmp_path / "there.ply").read_text() == "no map"
