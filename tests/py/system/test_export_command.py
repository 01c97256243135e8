"""`gslts export`, as a user meets it."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import scenes
from command import gslts as run
from plyfile import PlyData
from splat_files import ORIGIN, decoded
from written_maps import assert_same

from gslts.store.map_folder import read_map, write_map_folder


@pytest.mark.smoke
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
    assert "SH degree 0 only, the map has degree 2" in done.stdout
    np.testing.assert_allclose(
        np.sort(decoded(tmp_path / "new/b.splat").means[:, 0]),
        np.sort(gaussian_map.means[:, 0] + ORIGIN[0]),
        rtol=1e-6,
    )
    assert "rounded" not in done.stdout


def test_a_map_travels_through_other_formats(tmp_path: Path) -> None:
    gaussian_map = scenes.random_map(
        30, sh_degree=1, feature_dims=2, dtype=np.float32, origin=ORIGIN
    )
    write_map_folder(tmp_path / "map", gaussian_map, {"dataset": "kitchen"}, {})
    done = run("export", "map", "a.glb", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "features" not in done.stdout
    assert_same(read_map(tmp_path / "a.glb"), gaussian_map)
    text = (tmp_path / "a.glb").read_bytes()
    facts = json.loads(text[20 : 20 + struct.unpack_from("<I", text, 12)[0]])["nodes"][0]["extras"]
    assert facts["gslts"]["version"] == 1
    assert facts["gslts"]["description"] == "30 Gaussians, mapped from kitchen"
    assert (facts["gslts"]["types"], facts["gslts"]["objects"]) == ([], [])
    done = run("import", "a.glb", "--out", "imported", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "wrote imported: 30 Gaussians\n"), done.stderr
    assert_same(read_map(tmp_path / "imported"), gaussian_map)
    assert "imported from a.glb" in run("log", "imported", cwd=tmp_path).stdout
    for version, magic in ((4, b"NGSP"), (3, b"\x1f\x8b")):
        out = f"{version}.spz"
        done = run("export", "imported", out, "--spz-version", str(version), cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert done.stdout.endswith("; the format has no semantic features\n")
        assert (tmp_path / out).read_bytes().startswith(magic)
        np.testing.assert_allclose(
            read_map(tmp_path / out).means, gaussian_map.means + ORIGIN, atol=1.3e-4
        )
    done = run("import", "4.spz", "--out", "map", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (1, "gslts: map exists already\n")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.glb", b"", "a.glb: it is not a glTF"),
        ("a.spz", b"ply", "a.spz: no .spz file: it begins with neither NGSP nor a gzip stream"),
        ("a.ply", b"", "a.ply: no PLY file: it does not begin with 'ply'"),
        ("a.gltf", b"{}", "a.gltf: only binary glTF is read; save it as .glb"),
    ],
)
def test_what_cannot_be_imported(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    done = run("import", name, "--out", "map", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith(f"gslts: {message}")
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "map").exists()


def test_rounded_centres_give_a_warning(tmp_path: Path) -> None:
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
        (("map", "a.obj"), "gslts: a.obj: must end in .ply, .glb, .spz, .splat or .html"),
        (("map", "there.ply"), "gslts: there.ply is there already"),
        (("gone", "a.ply"), "gslts: gone: No such file or directory\n"),
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
