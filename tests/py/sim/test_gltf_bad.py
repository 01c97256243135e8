"""Tests of damaged, too large and hostile glTF files: each is rejected with one line."""

import io
import json
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import trimesh
from gltf_files import CUBE, Gltf, flat, four_colours, glb, quad, sized
from PIL import Image

from gslts.io import gltf_file
from gslts_sim import load_home
from gslts_sim.gltf import colour as gltf_colour
from gslts_sim.gltf import objects as gltf_objects
from gslts_sim.gltf import parts as gltf_parts
from gslts_sim.gltf.file import HomeFile


def assert_rejected(path: Path, match: str, error: type[Exception] = ValueError) -> None:
    with pytest.raises(error, match=match) as caught:
        load_home(path)
    message = str(caught.value)
    assert path.name in message
    assert "\n" not in message
    assert len(message) < 600


def test_file_cut_short_at_any_byte(tmp_path):
    file = quad(four_colours())
    data = file.glb()
    path = tmp_path / "cut.glb"
    for length in range(len(data)):
        path.write_bytes(data[:length])
        assert_rejected(path, "load_home: ")


def test_any_wrong_byte_is_rejected_or_read(tmp_path):
    data = quad(four_colours()).glb()
    rng = np.random.default_rng(5)
    path = tmp_path / "wrong.glb"
    for _ in range(400):
        wrong = bytearray(data)
        for place in rng.integers(0, len(data), 3):
            wrong[place] = rng.integers(256)
        path.write_bytes(wrong)
        try:
            load_home(path)
        except (ValueError, OSError) as error:
            assert "wrong.glb" in str(error)  # noqa: PT017
            assert "\n" not in str(error)  # noqa: PT017


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda data: b"glTX" + data[4:], "it is not a glTF"),
        (lambda data: data[:4] + struct.pack("<I", 1) + data[8:], "glTF 1, not 2"),
        (lambda data: data[:8] + struct.pack("<I", 2**32 - 1) + data[12:], "4294967295 bytes"),
        (lambda data: data[:12] + struct.pack("<I", 2**32 - 1) + data[16:], "is not its JSON"),
        (lambda data: data[:16] + b"BIN\0" + data[20:], "is not its JSON"),
        (lambda _: b"", "it is not a glTF"),
        (lambda _: b"ply\nformat ascii 1.0\n", "it is not a glTF"),
        (lambda _: b"[" * 100_000, "it is not a glTF"),
        (lambda _: b"[1, 2]", "asset.version is None"),
        (lambda _: b'{"asset": {"version": "1.0"}}', "asset.version is '1.0'"),
        (lambda _: b'{"asset": {"version": "2.0", "x": NaN}}', "NaN is not a number"),
        (lambda _: b'{"asset": {"version": "2.0"}}', "no node has a mesh"),
        (lambda _: b'{"asset": {"version": "2.0"}, "nodes": 3}', "nodes: expected a list"),
    ],
)  # fmt: skip
def test_false_containers_are_rejected(tmp_path, change, match):
    path = tmp_path / "bad.glb"
    path.write_bytes(change(flat().glb()))
    assert_rejected(path, match)


def edit(*keys, value):
    """Return a function that sets an entry deep in the JSON."""

    def change(file: Gltf) -> None:
        tree = file.tree
        for key in keys[:-1]:
            tree = tree[key]
        tree[keys[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (edit("nodes", 0, value={"mesh": 0}), "node 0 has a mesh, but neither it nor a node above"),
        (edit("nodes", 0, "mesh", value=7), r"meshes\[7\] does not exist"),
        (edit("nodes", 0, "children", value=[0]), r"node 0 \(Picture\) is a child more than once"),
        (edit("nodes", 0, "children", value=[-1]), "its child -1 does not exist"),
        (edit("nodes", 0, "translation", value=["a", 0, 0]), "trimesh cannot read it"),
        (edit("nodes", 0, "scale", value=[1e30, 1, 1]), "a vertex is over 10000 m from"),
        (edit("nodes", 0, "scale", value=[1e400, 1, 1]), "Infinity is not a number"),
        (edit("nodes", 0, "scale", value=[0, 0, 0]), "only degenerate ones"),
        (edit("nodes", 0, "extras", value={"movable": "yes"}), "extras.movable is 'yes'"),
        (edit("nodes", 0, "extras", value={"type": ""}), "extras.type is ''"),
        (edit("scenes", 0, "nodes", value=[3]), "a root of the scene does not exist"),
        (edit("scenes", value=[{"nodes": 3}]), "a root of the scene does not exist"),
        (edit("meshes", 0, "primitives", value=[]), r"node 0 \(Picture\): its mesh has no triang"),
        (edit("meshes", 0, "primitives", 0, "mode", value=1), "its mesh has no triangles"),
        (edit("meshes", 0, "primitives", 0, "mode", value=6), "fans are not supported"),
        (edit("meshes", 0, "primitives", 0, "attributes", value={}), "has no POSITION"),
        (edit("meshes", 0, "primitives", 0, "attributes", value=[3]), "damaged"),
        (edit("meshes", 0, "primitives", 0, "indices", value=1), "is not a list of SCALAR"),
        (edit("accessors", 1, "count", value=2**40), "1099511627776 entries"),
        (edit("accessors", 1, "count", value=0), "is not a list of VEC3"),
        (edit("accessors", 1, "count", value=-3), "is not a list of VEC3"),
        (edit("accessors", 1, "count", value=3), r"arrays of a primitive have \[3, 6\] entries"),
        (edit("accessors", 1, "byteOffset", value=2**62), "its 72 bytes hold fewer"),
        (edit("accessors", 1, "componentType", value=1), "is not a list of VEC3"),
        (edit("accessors", 1, "sparse", value={"count": 1}), "is sparse"),
        (edit("accessors", 1, value={"componentType": 5126, "count": 10**12, "type": "VEC3"}),
         "has no data"),
        (edit("bufferViews", 0, "byteStride", value=0), "rows of 8 bytes, 0 apart"),
        (edit("bufferViews", 0, "byteStride", value=10**15), "hold fewer"),
        (edit("bufferViews", 0, "byteLength", value=10**15), "1000000000000000 bytes"),
        (edit("bufferViews", 0, "buffer", value=1), r"buffers\[1\] does not exist"),
        (edit("materials", 0, "pbrMetallicRoughness", "baseColorFactor", value=[1]), "4 numbers"),
        (edit("textures", 0, value={}), "has no PNG, JPEG or WebP image"),
        (edit("images", 0, value={"uri": "/etc/passwd"}), "not lead into the folder"),
        (edit("images", 0, value={"uri": "../a.png"}), "not lead into the folder"),
        (edit("images", 0, value={"uri": "%2e%2e/a.png"}), "not lead into the folder"),
        (edit("images", 0, value={"uri": "https://a.org/a.png"}), "not lead into the folder"),
        (edit("images", 0, value={"uri": "file:///a.png"}), "not lead into the folder"),
        (edit("images", 0, value={"uri": "data:,abc"}), "only base64"),
        (edit("images", 0, value={"uri": "data:;base64,abc"}), "Incorrect padding"),
        (edit("images", 0, value={"bufferView": 0}), r"images\[0\] cannot be read as PNG"),
        (edit("images", 0, value={}), "is missing"),
        (edit("extensionsRequired", value=["KHR_draco_mesh_compression"]),
         "the extension KHR_draco_mesh_compression, which is not supported"),
        (edit("extensionsRequired", value=["EXT_meshopt_compression"]), "EXT_meshopt_compression"),
    ],
)  # fmt: skip
def test_false_json_is_rejected(tmp_path, change, match):
    file = quad(four_colours())
    change(file)
    assert_rejected(file.write(tmp_path / "bad.glb"), match)


def test_numbers_too_large_for_floats(tmp_path):
    file = quad()
    file.tree["nodes"][0]["scale"] = [1, 77777, 1]
    path = tmp_path / "bad.glb"
    path.write_bytes(file.glb().replace(b"77777", b"1e400", 1))
    assert_rejected(path, "not finite|trimesh cannot read it")


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_vertices_must_be_finite(tmp_path, wrong):
    file = Gltf()
    corners = CUBE.copy()
    corners[0, 1, 2] = wrong
    file.node(name="Mug", mesh=file.mesh(file.primitive(corners)))
    assert_rejected(file.write(tmp_path / "bad.glb"), rf"node 0 \(Mug\): vertex 1 is .*{wrong}")


def test_triangles_with_missing_vertices(tmp_path):
    file = Gltf()
    indices = file.array(np.array([0, 1, 36], np.uint16))
    file.node(name="Mug", mesh=file.mesh(file.primitive(CUBE, indices=indices)))
    assert_rejected(file.write(tmp_path / "bad.glb"), "Mug.*vertex 36 of 36")


def test_cycles_of_nodes(tmp_path):
    file = Gltf()
    mesh = file.mesh(file.primitive(CUBE))
    file.node(name="A", mesh=mesh)
    for child in (2, 3, 1):
        file.node(root=False, name="B", children=[child])
    assert_rejected(file.write(tmp_path / "bad.glb"), "is in a cycle or below")
    file.tree["scenes"] = [{"nodes": [2]}]
    assert_rejected(file.write(tmp_path / "bad.glb"), "is in a cycle or below")


def test_nodes_deep_below_each_other(tmp_path):
    file = Gltf()
    below = file.node(root=False, name="A", mesh=file.mesh(file.primitive(CUBE)))
    for _ in range(300):
        below = file.node(root=False, name="B", children=[below])
    file.tree["scenes"] = [{"nodes": [below]}]
    assert_rejected(file.write(tmp_path / "bad.glb"), "below 200 others")


def test_file_without_names(tmp_path):
    file = Gltf()
    child = file.node(root=False, mesh=file.mesh(file.primitive(CUBE)))
    file.node(children=[child])
    assert_rejected(file.write(tmp_path / "bad.glb"), "node 0 has a mesh, but neither")


def test_links_out_of_the_folder(tmp_path):
    (tmp_path / "secret.png").write_bytes(b"x")
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "link.png").symlink_to(tmp_path / "secret.png")
    file = quad(four_colours())
    file.tree["images"][0] = {"uri": "link.png"}
    assert_rejected(file.write(tmp_path / "in" / "bad.glb"), "not lead into the folder")


def test_paths_without_a_file(tmp_path):
    assert_rejected(tmp_path / "none.glb", "does not exist", FileNotFoundError)
    (tmp_path / "folder.glb").mkdir()
    assert_rejected(tmp_path / "folder.glb", "is not a file")
    file = quad(four_colours())
    file.tree["images"][0] = {"uri": "missing.png"}
    with pytest.raises(FileNotFoundError, match=r"missing\.png does not exist"):
        load_home(file.write(tmp_path / "a.glb"))


def test_limits(tmp_path, monkeypatch):
    path = quad(four_colours()).write(tmp_path / "large.glb")
    load_home(path)
    for module, name, value, match in (
        (HomeFile, "max_bytes", 500, "larger than 500"),
        (gltf_file, "MAX_JSON_BYTES", 100, "JSON has .* more than 100"),
        (gltf_file, "MAX_NODES", 0, "1 nodes, more than 0"),
        (gltf_parts, "MAX_CORNERS", 11, "more than 11 vertices"),
        (gltf_colour, "MAX_TEXTURE_PX", 1, "2 x 2 pixels"),
        (gltf_colour, "MAX_TOTAL_PX", 3, "over 3 pixels"),
    ):
        with monkeypatch.context() as limit:
            limit.setattr(module, name, value)
            assert_rejected(path, match)


@pytest.mark.parametrize("floor", [True, False])
@pytest.mark.parametrize("side", [0.002, 0.49, 100.1, 900.0])
def test_sizes_of_no_home(tmp_path, side, floor):
    file = Gltf()
    mesh = file.mesh(file.primitive(sized(side, 0.75 * side, 0.1 * side)))
    file.node(name="Floor|1" if floor else "Thing|1", mesh=mesh)
    path = file.write(tmp_path / "size.glb")
    assert_rejected(path, f"its rooms measure {side:.4g} x .* m; homes in metres have 0.5 to 100 m")
    file.tree["nodes"][0]["scale"] = [2 / side] * 3
    assert len(load_home(file.write(path)).rooms) == 1


@pytest.mark.parametrize("where", ["load_scene", "Textures", "filling_boxes"])
def test_lack_of_memory_is_no_damage(tmp_path, monkeypatch, where):
    path = quad(four_colours()).write(tmp_path / "good.glb")
    module = {"Textures": gltf_parts, "filling_boxes": gltf_objects}.get(where, trimesh)
    monkeypatch.setattr(module, where, lambda *_, **__: (_ for _ in ()).throw(MemoryError))
    with pytest.raises(MemoryError):
        load_home(path)


def test_one_mesh_at_many_nodes_counts_each_time(tmp_path, monkeypatch):
    file = Gltf()
    mesh = file.mesh(file.primitive(CUBE))
    for k in range(4):
        file.node(name=f"A{k}", mesh=mesh)
    monkeypatch.setattr(gltf_parts, "MAX_CORNERS", 4 * 72 - 1)
    assert_rejected(file.write(tmp_path / "many.glb"), "vertices and corners")


def test_image_that_would_be_huge(tmp_path):
    """The size of an image is checked before its pixels are allocated."""
    file = io.BytesIO()
    Image.new("L", (8, 8)).save(file, "PNG")
    data = bytearray(file.getvalue())
    data[16:24] = struct.pack(">II", 60_000, 60_000)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    gltf = quad(four_colours())
    gltf.tree["images"][0] = {"bufferView": gltf.view(bytes(data))}
    assert_rejected(gltf.write(tmp_path / "bomb.glb"), r"images\[0\]")


def test_gltf_is_not_glb(tmp_path):
    path = tmp_path / "alone.gltf"
    path.write_text(json.dumps(flat().tree | {"buffers": [{"byteLength": 4}]}))
    assert_rejected(path, "is missing")
    path.write_bytes(glb(b"{}", b""))
    assert_rejected(path, "asset.version is None")
