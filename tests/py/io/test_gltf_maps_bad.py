"""Damaged and hostile .glb files of Gaussians: each is rejected in one line that names the file."""

import json
import re
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaged_maps import assert_map_or_one_line
from hypothesis import given
from hypothesis import strategies as st
from ply_maps import float_map
from splat_glb import EXTENSION, SplatGlb

from gslts.io.gltf_read import read_glb
from gslts.io.gltf_write import write_glb

OPACITY, SCALE = f"{EXTENSION}:OPACITY", f"{EXTENSION}:SCALE"


def error_of(path: Path) -> str:
    """Return the error of reading, which is one short line that begins with the path."""
    with pytest.raises(ValueError, match=re.escape(f"{path}: ")) as caught:
        read_glb(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) < 500
    return message.removeprefix(f"{path}: ")


def put(*keys: Any, value: Any) -> Callable[[SplatGlb], None]:
    """Return a function that sets an entry deep in the JSON."""

    def change(file: SplatGlb) -> None:
        tree: Any = file.tree
        for key in keys[:-1]:
            tree = tree[key]
        tree[keys[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.extension.update(kernel="disc"), "kernel is 'disc', only 'ellipse' is read"),
        (lambda f: f.extension.pop("kernel"), "kernel is None"),
        (lambda f: f.extension.update(colorSpace="lin_rec709_display"), "colorSpace is 'lin_"),
        (lambda f: f.extension.update(projection="fisheye"), "projection is 'fisheye'"),
        (lambda f: f.extension.update(extensions={"KHR_x": {}}), "extended by {'KHR_x': {}}"),
        (lambda f: f.extension.update(extensions=5), "extended by 5, not supported"),
        (lambda f: f.primitive.update(mode=4), "belongs to points, mode 0, got mode 4"),
        (lambda f: f.primitive.update(extensions={}), "expected one primitive with KHR_gaussian"),
        (lambda f: f.primitive.update(attributes=[1]), "its primitive has no attributes"),
        (lambda f: f.primitive["attributes"].pop("POSITION"), "have no attribute POSITION"),
        (lambda f: f.primitive["attributes"].pop(SCALE), f"have no attribute {SCALE}"),
        (lambda f: f.primitive["attributes"].update(POSITION=99), "accessors[99] does not exist"),
        (lambda f: f.add(f"{EXTENSION}:SH_DEGREE_1_COEF_0", [[0, 0, 0]] * 2), "DEGREE_1_COEF_1"),
        (lambda f: f.add("_ID", [[0, 0, 0, 0]] * 2), "_ID: expected 16-bit numbers"),
        (lambda f: f.add("_ID", [[0, 0, 0, 0]] * 2, np.uint16), "ids: 0 occurs more than once"),
        (lambda f: f.add("POSITION", [[0, np.nan, 0]] * 2), "Gaussian 0: POSITION: expected a fin"),
        (lambda f: f.add("POSITION", [[0, 0, 0], [0, 0, np.inf]]), "Gaussian 1: POSITION"),
        (lambda f: f.add(OPACITY, [[0.5], [1.5]]), f"Gaussian 1: {OPACITY}: expected 0 to 1, got"),
        (lambda f: f.add(OPACITY, [[-0.5], [0]]), f"Gaussian 0: {OPACITY}: expected 0 to 1, got"),
        (lambda f: f.add(SCALE, [[1, 1, -1]] * 2), f"Gaussian 0: {SCALE}: expected 0 or more"),
        (lambda f: f.add(OPACITY, [[0.5]] * 3), f"{OPACITY} has 3 entries, POSITION 2"),
        (lambda f: f.accessor("POSITION").update(count=2**40), "says 1099511627776 entries"),
        (lambda f: f.accessor("POSITION").update(count=-1), "is not a list of VEC3"),
        (lambda f: f.accessor("POSITION").update(count=2.5), "is not a list of VEC3"),
        (lambda f: f.accessor("POSITION").update(type="VEC4"), "is not a list of VEC3"),
        (lambda f: f.accessor("POSITION").update(componentType=[1]), "is not a list of VEC3"),
        (lambda f: f.accessor("POSITION").update(byteOffset=8), "hold fewer"),
        (lambda f: f.accessor("POSITION").update(byteOffset=-8), "rows of 12 bytes"),
        (lambda f: f.accessor("POSITION").update(sparse={}), "is sparse"),
        (put("bufferViews", 0, "byteStride", value=1), "rows of 12 bytes, 1 apart"),
        (put("bufferViews", 0, "byteLength", value=10**9), "its buffer has"),
        (put("bufferViews", 0, "buffer", value=1), "buffers[1] does not exist"),
        (put("buffers", value=[{"byteLength": 10**12}]), "says 1000000000000 bytes"),
        (put("buffers", value=[{"uri": "data:;base64,AAAA", "byteLength": 3}]), "the URI 'data:;"),
        (put("buffers", value=[{"uri": "/etc/passwd", "byteLength": 3}]), "the URI '/etc/passwd'"),
        (put("buffers", value=[{"uri": "http://x/y", "byteLength": 3}]), "only buffers inside of"),
        (put("extensionsRequired", value=["KHR_spz"]), "needs the extension KHR_spz"),
        (put("extensionsRequired", value=[7]), "needs the extension 7"),
        (put("nodes", 0, "matrix", value=[1] * 15), "matrix: expected 16 finite numbers"),
        (put("nodes", 0, "matrix", value=[0] * 16), "its matrix is not affine"),
        (put("nodes", 0, "matrix", value=["x"] * 16), "matrix: expected 16 finite numbers"),
        (put("nodes", 0, "scale", value=[1, 2, 1]), "node 0: expected one scale for all axes"),
        (put("nodes", 0, "scale", value=[1, -1, 1]), "node 0: expected a rotation with a positive"),
        (put("nodes", 0, "scale", value=[1e200] * 3), "node 0: "),
        (put("nodes", 0, "rotation", value=[1e200, 0, 0, 1e200]), "no unit quaternion"),
        (put("nodes", 0, "translation", value={}), "translation: expected 3 finite numbers"),
        (put("nodes", 0, "rotation", value=[0, 0, 0, 0]), "no unit quaternion"),
        (put("nodes", 0, "children", value=[0]), "is a child more than once"),
        (put("nodes", value=[{"mesh": 0}, {"mesh": 0}]), None),
        (put("scenes", 0, "nodes", value=[]), "expected one primitive"),
        (put("meshes", 0, "primitives", value=[None]), "expected one primitive"),
    ],
)  # fmt: skip
def test_wrong_fields(tmp_path: Path, change: Any, message: str | None) -> None:
    file = SplatGlb()
    change(file)
    path = file.write(tmp_path / "bad.glb")
    if message is None:
        read_glb(path)  # A node that the scene does not show.
    else:
        assert message in error_of(path)


def test_names_of_nodes_do_not_control_the_terminal(tmp_path: Path) -> None:
    file = SplatGlb()
    file.tree["nodes"][0]["name"] = "\x1b[2J\n\x9bx"
    file.primitive.pop("attributes")
    message = error_of(file.write(tmp_path / "a.glb"))
    assert message == "node 0 (\\x1b[2J \\x9bx): its primitive has no attributes"


def test_two_primitives_of_gaussians(tmp_path: Path) -> None:
    file = SplatGlb()
    file.tree["meshes"][0]["primitives"].append(file.primitive)
    message = error_of(file.write(tmp_path / "a.glb"))
    assert "got 2; merge them in the program that wrote the file" in message


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "it is not a glTF"),
        (b"ply\n", "it is not a glTF"),
        (b"[" * 100_000, "it is not a glTF"),
        (struct.pack("<4sII", b"glTF", 1, 20) + bytes(8), "it is glTF 1, not 2"),
        (struct.pack("<4sII", b"glTF", 2, 2**32 - 1) + bytes(8), "its header says 4294967295"),
        (b'{"asset": {"version": "2.0"}}', "expected one primitive"),
    ],
)
def test_false_containers(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "bad.glb"
    path.write_bytes(content)
    assert message in error_of(path)


def test_truncated_file(tmp_path: Path) -> None:
    content = SplatGlb(4).glb()
    path = tmp_path / "cut.glb"
    for length in [*range(40), *range(40, len(content), 7), len(content) - 1]:
        path.write_bytes(content[:length])
        error_of(path)


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none\.glb does not exist"):
        read_glb(tmp_path / "none.glb")
    assert "is not a file" in error_of(Path("/dev/zero"))


def test_features_that_share_their_numbers_take_no_memory(tmp_path: Path) -> None:
    """A small file cannot ask for a gigabyte: 20,000 features of 20,000 Gaussians."""
    file = SplatGlb()
    count = 20_000
    for name, width in (("POSITION", 3), (f"{EXTENSION}:ROTATION", 4), (SCALE, 3), (OPACITY, 1)):
        file.add(name, np.ones((count, width)))
    file.add(f"{EXTENSION}:SH_DEGREE_0_COEF_0", np.ones((count, 3)))
    ones = file.primitive["attributes"][OPACITY]
    file.primitive["attributes"] |= {f"_FEATURE_{k}": ones for k in range(count)}
    path = file.write(tmp_path / "a.glb")
    tracemalloc.start()
    message = error_of(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert message == f"{count} features of {count} Gaussians share their numbers"
    assert peak < 40e6


@given(data=st.data())
def test_damaged_file_gives_a_map_or_one_line(tmp_path_factory: Any, data: st.DataObject) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.glb"
    write_glb(float_map(3, sh_degree=1, feature_dims=1).select(np.array([2, 0])), path)
    assert_map_or_one_line(path, data, read_glb)


@given(data=st.data())
def test_any_json_in_any_field(tmp_path_factory: Any, data: st.DataObject) -> None:
    """Each entry of the JSON in turn becomes another value."""
    file = SplatGlb()
    tree: Any = file.tree
    for _ in range(data.draw(st.integers(1, 6))):
        keys = list(tree) if isinstance(tree, dict) else list(range(len(tree)))
        if not keys:
            break
        key = data.draw(st.sampled_from(keys))
        if not isinstance(tree[key], dict | list):
            break
        tree = tree[key]
    scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3)
    value = data.draw(st.recursive(scalars, lambda s: st.lists(s, max_size=2), max_leaves=3))
    if isinstance(tree, dict):
        tree[data.draw(st.sampled_from([*tree, "mesh", "uri", "byteStride"]))] = value
    elif tree:
        tree[data.draw(st.integers(0, len(tree) - 1))] = value
    path = tmp_path_factory.getbasetemp() / "fields.glb"
    try:
        path.write_bytes(file.glb())
    except (TypeError, KeyError, struct.error, json.JSONDecodeError):
        return
    try:
        read_glb(path)
    except ValueError as error:
        assert str(error).startswith(f"{path}: ")  # noqa: PT017
        assert "\n" not in str(error)  # noqa: PT017
