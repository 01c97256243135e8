"""PLY files, against `plyfile` as an independent reader and writer."""

import errno
import logging
import os
import resource
from pathlib import Path
from typing import Any

import numpy as np
import plyfile
import pytest
import scenes
from damaged_maps import assert_map_or_one_line
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from ply_maps import columns_of, float_map
from written_maps import assert_same, maps

import gslts

FORMATS = [{"text": True}, {"byte_order": "<"}, {"byte_order": ">"}]
LIST_FORMATS = FORMATS[:2]  # plyfile 1.1 writes rows with lists in the wrong order of bytes.


def element(name: str, columns: dict[str, Any], **options: Any) -> plyfile.PlyElement:
    size = len(next(iter(columns.values())))
    rows = np.empty(size, [(key, np.asarray(column).dtype) for key, column in columns.items()])
    for key, column in columns.items():
        rows[key] = column
    return plyfile.PlyElement.describe(rows, name, **options)


def ragged(*rows: list[float], dtype: Any = np.int32) -> NDArray[Any]:
    result = np.empty(len(rows), object)
    result[:] = [np.array(row, dtype) for row in rows]
    return result


@pytest.mark.parametrize("sh_degree", [0, 1, 2, 3])
@pytest.mark.parametrize("size", [0, 1, 3000])
def test_plyfile_reads_what_is_written(tmp_path, size, sh_degree):
    gaussians = float_map(size, sh_degree=sh_degree)
    gslts.write_ply(gaussians, tmp_path / "map.ply")
    contents = plyfile.PlyData.read(tmp_path / "map.ply")
    assert [e.name for e in contents.elements] == ["vertex"]
    vertex = contents["vertex"]
    columns = columns_of(gaussians)
    assert [p.name for p in vertex.properties] == list(columns)
    assert {p.val_dtype for p in vertex.properties} == {"f4"}
    for name, column in columns.items():
        np.testing.assert_array_equal(vertex[name], column)
    assert_same(gslts.read_ply(tmp_path / "map.ply"), gaussians)


@pytest.mark.parametrize("layout", FORMATS)
@pytest.mark.parametrize("sh_degree", [0, 1, 2, 3])
def test_reads_what_plyfile_writes_in_any_order(tmp_path, layout, sh_degree, caplog):
    gaussians = float_map(700, sh_degree=sh_degree)
    columns = columns_of(gaussians)
    names = np.random.default_rng(0).permutation(list(columns))
    vertex = element("vertex", {name: columns[name] for name in names})
    plyfile.PlyData([vertex], **layout, comments=["one", "gslts"], obj_info=["two words"]).write(
        tmp_path / "map.ply"
    )
    assert_same(gslts.read_ply(tmp_path / "map.ply"), gaussians)
    assert not caplog.records


@pytest.mark.parametrize("layout", FORMATS)
@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"])
def test_numbers_of_any_type_become_float(tmp_path, layout, dtype):
    gaussians = float_map(20, sh_degree=1)
    rng = np.random.default_rng(1)
    if dtype[0] == "f":
        columns = {n: rng.normal(size=20).astype(dtype) for n in columns_of(gaussians)}
    else:
        limits = np.iinfo(dtype)
        columns = {
            name: rng.integers(limits.min, limits.max, 20, dtype, endpoint=True)
            for name in columns_of(gaussians)
        }
    plyfile.PlyData([element("vertex", columns)], **layout).write(tmp_path / "map.ply")
    read = columns_of(gslts.read_ply(tmp_path / "map.ply"))
    for name in set(columns) - {"nx", "ny", "nz"}:
        np.testing.assert_array_equal(read[name], columns[name].astype(np.float32))


@pytest.mark.parametrize("layout", LIST_FORMATS)
def test_other_elements_and_properties_are_skipped(tmp_path, layout, caplog):
    gaussians = float_map(3)
    lists = {"indices": ragged([1, 2, 3], [], [4]), "kind": np.array([1, 2, 3], "u1")}
    options = {"len_types": {"indices": "u1"}, "val_types": {"indices": "i4"}}
    weights = {"weights": ragged([], [0.5], [1, 2], dtype="f8")}
    columns = {"red": np.arange(3, dtype="u1")} | weights | columns_of(gaussians)
    plyfile.PlyData(
        [
            element("face", lists, **options),
            element("vertex", columns, len_types={"weights": "i2"}, val_types={"weights": "f8"}),
            element("edge", lists, **options),
            element("material", {"shine": np.zeros(2)}),
        ],
        **layout,
    ).write(tmp_path / "map.ply")
    assert_same(gslts.read_ply(tmp_path / "map.ply"), gaussians)
    (record,) = caplog.records
    assert (record.name, record.levelno) == ("gslts.io.ply", logging.WARNING)
    assert record.getMessage() == (
        f"{tmp_path / 'map.ply'}: ignored properties of vertex: red, weights"
    )


@pytest.mark.parametrize("order", "<>")
def test_binary_lists_of_either_byte_order(tmp_path, order):
    """Lists of one length make rows of one size, which numpy can write."""
    gaussians = float_map(9000, sh_degree=1)
    columns = columns_of(gaussians)
    lists = [("n", order + "u2"), ("items", order + "f8", 3)]
    rows = np.empty(9000, [*((name, order + "f4") for name in columns), *lists])
    for name, column in columns.items():
        rows[name] = column
    rows["n"], rows["items"] = 3, 7
    name = {"<": "little", ">": "big"}[order]
    faces = rows[["n", "items"]].astype(lists)
    list_property = "property list ushort double items"
    header = [
        "ply",
        f"format binary_{name}_endian 1.0",
        "element face 9000",
        list_property,
        "element vertex 9000",
        *(f"property float {name}" for name in columns),
        list_property,
        "element edge 9000",
        list_property,
        "end_header\n",
    ]
    contents = "\n".join(header).encode() + faces.tobytes() + rows.tobytes() + faces.tobytes()
    (tmp_path / "map.ply").write_bytes(contents)
    assert_same(gslts.read_ply(tmp_path / "map.ply"), gaussians)


def test_carriage_returns_in_the_header_are_no_part_of_names(tmp_path):
    gaussians = float_map(3, sh_degree=1)
    path = tmp_path / "map.ply"
    gslts.write_ply(gaussians, path)
    header, rows = path.read_bytes().split(b"end_header\n")
    path.write_bytes(header.replace(b"\n", b"\r\n") + b"end_header\r\n" + rows)
    assert_same(gslts.read_ply(path), gaussians)


def test_lists_across_blocks(tmp_path):
    """The file is read in blocks of 256 KiB; lists, numbers and words lie across their ends."""
    gaussians = float_map(20_000)
    rng = np.random.default_rng(0)
    lists = ragged(*(list(range(n)) for n in rng.integers(0, 9, gaussians.size)))
    vertex = element("vertex", columns_of(gaussians) | {"seen": lists})
    for layout in LIST_FORMATS:
        plyfile.PlyData([vertex], **layout).write(tmp_path / "map.ply")
        assert_same(gslts.read_ply(tmp_path / "map.ply"), gaussians)


@given(gaussians=maps())
def test_round_trip_keeps_every_bit(tmp_path_factory, gaussians):
    path = tmp_path_factory.getbasetemp() / "round_trip.ply"
    gslts.write_ply(gaussians, path)
    assert_same(gslts.read_ply(path), gaussians)


@given(data=st.data())
def test_damaged_file_gives_a_map_or_one_line(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "damaged.ply"
    gaussians = float_map(3, sh_degree=1, feature_dims=1).select(np.array([2, 0]))
    text = data.draw(st.booleans())
    plyfile.PlyData([element("vertex", columns_of(gaussians))], text=text).write(path)
    assert_map_or_one_line(path, data, gslts.read_ply)


def test_features_and_ids_have_properties_of_their_own(tmp_path):
    gaussians = float_map(5, feature_dims=2, origin=(1e6, -2, 0.1)).select(np.array([3, 1]))
    gslts.write_ply(gaussians, tmp_path / "map.ply")
    contents = plyfile.PlyData.read(tmp_path / "map.ply")
    vertex = contents["vertex"]
    assert contents.comments == ["gslts origin 1e+06 -2 0.1"]
    np.testing.assert_array_equal(vertex["feature_1"], gaussians.features[:, 1])
    np.testing.assert_array_equal(vertex["id_low"], np.array([3, 1], np.uint32))
    np.testing.assert_array_equal(vertex["id_high"], np.array([0, 0], np.uint32))
    assert_same(gslts.read_ply(tmp_path / "map.ply"), gaussians)


def test_bad_contents_are_a_value_error(tmp_path):
    path = tmp_path / os.fsdecode(b"not utf-8 \xff.ply")
    gslts.write_ply(float_map(3), path)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(ValueError, match="header line 3: element 'vertex' of 3 rows") as error:
        gslts.read_ply(path)
    assert str(error.value).startswith(f"{path}: ")
    path.write_bytes(b"solid cube")
    with pytest.raises(ValueError, match=r"no PLY file: it does not begin with 'ply'$"):
        gslts.read_ply(path)


def test_errors_of_the_system_are_os_errors(tmp_path):
    missing = tmp_path / "missing.ply"
    with pytest.raises(FileNotFoundError) as error:
        gslts.read_ply(missing)
    assert str(error.value) == f"[Errno 2] No such file or directory: '{missing}'"
    with pytest.raises(IsADirectoryError):
        gslts.read_ply(tmp_path)
    gaussians = float_map(3)
    with pytest.raises(FileNotFoundError) as error:
        gslts.write_ply(gaussians, missing / "map.ply")
    assert error.value.filename == str(missing / "map.ply")
    with pytest.raises(IsADirectoryError):
        gslts.write_ply(gaussians, tmp_path)
    with pytest.raises(OSError, match="not supported: '/dev/full'") as error:
        gslts.write_ply(gaussians, "/dev/full")
    assert error.value.errno == errno.ENOTSUP
    assert Path("/dev/full").is_char_device()
    assert list(tmp_path.iterdir()) == []


def test_write_that_fails_leaves_the_old_file(tmp_path):
    path = tmp_path / "map.ply"
    path.write_text("old")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, hard))
    try:
        with pytest.raises(OSError, match="File too large"):
            gslts.write_ply(float_map(5000), path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_map_in_double_is_rejected(tmp_path):
    with pytest.raises(ValueError, match=r"float64.*gaussian_map\.astype\(np\.float32\)"):
        gslts.write_ply(scenes.random_map(3), tmp_path / "map.ply")
    assert list(tmp_path.iterdir()) == []
