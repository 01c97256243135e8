"""Maps in .spz files: own round trips, every number of a file, damaged and hostile files."""

import re
import struct
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from damaged_maps import assert_map_or_one_line
from gaussian_shapes import assert_same_gaussians
from hypothesis import given
from hypothesis import strategies as st
from ply_maps import float_map
from spz_files import (
    ALPHA,
    COLOR,
    HARMONICS,
    POSITION,
    ROTATION,
    SCALE,
    STREAMS,
    gzip_file,
    header,
    zstd_file,
)

import gslts
from gslts.core.gaussian_map import SH_C0
from gslts.core.se3 import rotation_of_quat
from gslts.core.similarity import transform_map
from gslts.io.gltf_file import Z_UP
from gslts.io.spz import read_spz, rounding_m, write_spz
from gslts.io.spz_streams import zstd


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def in_file_axes(path: Path) -> gslts.GaussianMap:
    return transform_map(read_spz(path), Z_UP.T)


@pytest.mark.parametrize("version", [3, 4])
def test_every_number_of_a_gaussian(tmp_path: Path, version: int) -> None:
    pack = zstd_file if version == 4 else lambda head, streams: gzip_file(head, *streams)
    read = in_file_axes(written(tmp_path / "a.spz", pack(header(version, 1, 1), STREAMS)))
    np.testing.assert_allclose(read.means, [[1, -1.5, 5 / 4096]], atol=1e-7)
    opacity = 1 / (1 + np.exp(-read.logit_opacities.astype(np.float64)))
    np.testing.assert_allclose(opacity, [0.2], rtol=1e-6)
    np.testing.assert_allclose(read.log_scales, [[-10, 0, 95 / 16]])
    np.testing.assert_allclose(read.sh[0, 0], (np.array([0, 128, 255]) / 255 - 0.5) / 0.15)
    expected = (np.frombuffer(HARMONICS, np.uint8).astype(np.float32) - 128) / 128
    np.testing.assert_allclose(read.sh[0, 1:].ravel(), expected, atol=1e-6)
    # xyzw: the largest is w, the others are -1/sqrt(2), 0 and 100/511 of it.
    x, z = -np.sqrt(0.5), 100 / 511 * np.sqrt(0.5)
    turn = rotation_of_quat(np.array([np.sqrt(1 - x * x - z * z), x, 0, z]))
    np.testing.assert_allclose(rotation_of_quat(read.quats[0]), turn, atol=1e-6)


def test_old_versions(tmp_path: Path) -> None:
    """Version 2 has 8 bits for x, y, z of a quaternion, version 1 also half-precision centres."""
    old = bytes([255, 0, 128])
    for version, position in ((2, POSITION), (1, np.array([1, -1.5, 0.25], "<f2").tobytes())):
        content = gzip_file(header(version, 1, 0), position, ALPHA, COLOR, SCALE, old)
        read = in_file_axes(written(tmp_path / "a.spz", content))
        np.testing.assert_allclose(read.means[0, :2], [1, -1.5])
        w, x, y, z = read.quats[0] / np.linalg.norm(read.quats[0])
        np.testing.assert_allclose(np.abs([x, y]), np.sqrt(0.5), atol=0.01)
        assert x * y < 0
        assert max(abs(w), abs(z)) < 0.01


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("sh_degree", [0, 1, 2, 3])
def test_round_trip_within_the_steps_of_the_format(
    tmp_path: Path, version: int, sh_degree: int
) -> None:
    gaussian_map = float_map(2000, sh_degree=sh_degree, origin=(20, -30.5, 1))
    gaussian_map = gslts.GaussianMap(
        means=gaussian_map.means,
        quats=gaussian_map.quats,
        log_scales=gaussian_map.log_scales,
        logit_opacities=gaussian_map.logit_opacities,
        sh=gaussian_map.sh.clip(-0.3, 0.3),
        origin=gaussian_map.origin,
    )
    write_spz(gaussian_map, tmp_path / "a.spz", version)
    # Harmonics are rounded in the axes of the file: 6 bits of -1 to 1.
    expected = transform_map(gaussian_map, Z_UP.T)
    assert_same_gaussians(
        in_file_axes(tmp_path / "a.spz"),
        expected,
        mean_m=1.3e-4,
        covariance=0.07,
        sh=2.5 / 128,
        color=0.5 / 255 / 0.15 + 1e-6,
        opacity=0.5 / 255 + 1e-6,
    )


@pytest.mark.parametrize("version", [3, 4])
def test_what_was_rounded_is_not_rounded_again(tmp_path: Path, version: int) -> None:
    """Writing what was read changes nothing that is stored in axes of its own."""
    write_spz(float_map(500, sh_degree=0), tmp_path / "a.spz", version)
    once = read_spz(tmp_path / "a.spz")
    write_spz(once, tmp_path / "b.spz", version)
    twice = read_spz(tmp_path / "b.spz")
    for name in ("means", "log_scales", "logit_opacities"):
        np.testing.assert_array_equal(getattr(once, name), getattr(twice, name))
    np.testing.assert_allclose(once.sh, twice.sh, atol=1e-6)


def test_it_renders_the_same_colours_to_the_precision_of_bytes(tmp_path: Path) -> None:
    gaussian_map = scenes.random_map(300, dtype=np.float32)
    write_spz(gaussian_map, tmp_path / "a.spz")
    camera = scenes.orbit_camera(160, 120)
    expected = gslts.render(gaussian_map, camera).rgb
    difference = np.abs(gslts.render(read_spz(tmp_path / "a.spz"), camera).rgb - expected)
    assert np.ptp(expected) > 0.5
    assert difference.mean() < 0.005
    assert np.quantile(difference, 0.999) < 0.06


def test_values_beyond_the_range_of_the_format_end_at_its_limits(tmp_path: Path) -> None:
    gaussian = scenes.single_gaussian(
        np.float32,
        quats=np.zeros((1, 4)),
        log_scales=[[-50, 50, 0]],
        logit_opacities=[90],
        sh=[[[-99, 99, 0.5 / SH_C0]] + [[-2, 2, 1]] * 3],
    )
    write_spz(gaussian, tmp_path / "a.spz")
    read = in_file_axes(tmp_path / "a.spz")
    assert read.log_scales.tolist() == [[-10, 5.9375, 0]]
    assert read.logit_opacities.tolist() == [20]
    np.testing.assert_allclose(read.sh[0, 0, :2], [-0.5 / 0.15, 0.5 / 0.15], rtol=1e-6)
    np.testing.assert_allclose(np.abs(read.sh[0, 1:, :2]), 1, atol=1 / 128 + 1e-6)


def test_a_wide_map_has_coarser_centres(tmp_path: Path) -> None:
    gaussian_map = float_map(100, origin=(0, 5_432_109.5, 0))
    assert rounding_m(gaussian_map) == 0.5
    write_spz(gaussian_map, tmp_path / "a.spz")
    read = read_spz(tmp_path / "a.spz")
    error = read.means - (gaussian_map.means + gaussian_map.origin)
    assert 0.4 < np.abs(error).max() <= 0.51
    far = float_map(1, origin=(0, 1e9, 0))
    with pytest.raises(ValueError, match=r"a\.spz: a Gaussian 1e\+09 m from the origin; write a"):
        write_spz(far, tmp_path / "a.spz")


@pytest.mark.parametrize("version", [3, 4])
def test_no_gaussians(tmp_path: Path, version: int) -> None:
    write_spz(float_map(0, sh_degree=2), tmp_path / "a.spz", version)
    assert (read_spz(tmp_path / "a.spz").size, read_spz(tmp_path / "a.spz").sh_degree) == (0, 2)


def test_degree_4_and_antialiasing_give_warnings(tmp_path: Path, caplog: Any) -> None:
    harmonics = bytes(range(72))
    content = zstd_file(header(4, 1, 4, flags=1), [*STREAMS[:5], harmonics])
    read = in_file_axes(written(tmp_path / "a.spz", content))
    assert read.sh_degree == 3
    assert read.sh[0, 15, 2] == pytest.approx((44 - 128) / 128, abs=0.2)
    messages = [record.getMessage() for record in caplog.records]
    assert ["antialiasing" in messages[0], "degree 4 are left out" in messages[1]] == [True] * 2


def test_extensions_are_skipped(tmp_path: Path) -> None:
    record = struct.pack("<II", 0xADBE0002, 4) + b"abcd"
    plain = read_spz(written(tmp_path / "a.spz", zstd_file(header(4, 1, 1), STREAMS)))
    content = zstd_file(header(4, 1, 1, flags=2), STREAMS, extensions=record)
    assert read_spz(written(tmp_path / "b.spz", content)).sh.tobytes() == plain.sh.tobytes()
    content = gzip_file(header(3, 1, 1, flags=2), *STREAMS, record)
    assert read_spz(written(tmp_path / "c.spz", content)).sh.tobytes() == plain.sh.tobytes()


def axes_record(number: int) -> bytes:
    """Return records of extensions: an unknown one, and the axes of the file."""
    return struct.pack("<II4xIII", 0xADBE0002, 4, 0xADBE0003, 4, number)


def turned_file(version: int, number: int) -> bytes:
    """Return a file whose axes have that number in the enumeration of Niantic's library."""
    head, record = header(version, 1, 1, flags=2), axes_record(number)
    if version == 4:
        return zstd_file(head, STREAMS, extensions=record)
    return gzip_file(head, *STREAMS, record)


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize(
    ("number", "axes"), [(0, "RUB"), (1, "LDB"), (4, "RUB"), (6, "RDF"), (7, "LUF")]
)
def test_other_axes_are_turned(tmp_path: Path, version: int, number: int, axes: str) -> None:
    turn = np.diag([1.0 if axis in "RUB" else -1.0 for axis in axes])
    plain = in_file_axes(written(tmp_path / "a.spz", zstd_file(header(4, 1, 1), STREAMS)))
    read = in_file_axes(written(tmp_path / "b.spz", turned_file(version, number)))
    np.testing.assert_allclose(read.means[0], turn @ plain.means[0], atol=1e-6)
    rotations = [rotation_of_quat(each.quats[0]) for each in (read, plain)]
    np.testing.assert_allclose(rotations[0], turn @ rotations[1], atol=1e-6)
    # The bases of degree 1 are -y, z, -x.
    vectors = [each.sh[0, [3, 1, 2]] * [[-1], [-1], [1]] for each in (read, plain)]
    np.testing.assert_allclose(vectors[0], turn @ vectors[1], atol=1e-6)


@pytest.mark.parametrize("number", [2, 3, 5, *range(8, 18), 2**32 - 1])
def test_axes_that_are_not_supported_are_rejected(tmp_path: Path, number: int) -> None:
    for version in (3, 4):
        assert error_of(written(tmp_path / "a.spz", turned_file(version, number))) == (
            f"SPZ_ADOBE_coordinate_system {number}: these axes are not supported; store it without "
            "this extension"
        )


def test_records_that_are_cut_off_are_skipped(tmp_path: Path) -> None:
    for size in range(24):
        record = axes_record(6)[:size]
        for version in (3, 4):
            head = header(version, 1, 1, flags=2)
            content = (
                zstd_file(head, STREAMS, extensions=record)
                if version == 4
                else gzip_file(head, *STREAMS, record)
            )
            assert in_file_axes(written(tmp_path / "a.spz", content)).means[0, 1] == -1.5


def error_of(path: Path) -> str:
    """Return the error of reading, which is one short line that begins with the path."""
    with pytest.raises(ValueError, match=re.escape(f"{path}: ")) as caught:
        read_spz(path)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 400
    return message.removeprefix(f"{path}: ")


GOOD = zstd_file(header(4, 1, 1), STREAMS)
HARMONICS_FRAME = len(zstd.compress(HARMONICS))
LONG = (POSITION + b"x", *STREAMS[1:])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "it begins with neither NGSP nor a gzip stream"),
        (b"ply\nformat", "it begins with neither NGSP nor a gzip stream"),
        (GOOD[:20], "the file ends in its header"),
        (gzip_file(b"NGSP"), "the file ends in its header"),
        (gzip_file(b"not NGSP's header"), "the gzip stream does not begin with NGSP"),
        (gzip_file(header(4, 1, 1), *STREAMS), "version 4 is not supported here"),
        (gzip_file(header(5, 1, 1), *STREAMS), "version 5 is not supported here"),
        (zstd_file(header(3, 1, 1), STREAMS), "version 3 is not supported here"),
        (zstd_file(header(4, 1, 5), STREAMS), "damaged header: degree 5, 12 fractional bits"),
        (zstd_file(header(4, 1, 1, bits=25), STREAMS), "degree 1, 25 fractional bits"),
        (gzip_file(header(3, 2, 1), *STREAMS), "the attributes have 29 bytes, 2 Gaussians 58"),
        (gzip_file(header(3, 1, 0), *STREAMS), "the gzip stream does not end after 1 Gaussians"),
        (gzip_file(header(3, 1, 1), *STREAMS)[:-1], "the gzip stream does not end after 1"),
        (gzip_file(header(3, 1, 1), *STREAMS)[:-8] + bytes(8), "damaged gzip stream"),
        (zstd_file(header(4, 1, 0), STREAMS), "damaged header: 6 streams, expected 5"),
        (zstd_file(header(4, 2, 1), STREAMS), "positions: 9 bytes for 2 Gaussians, not 18"),
        (zstd_file(header(4, 1, 1), LONG, table=[(19, 9)] * 6), "positions: the stream does not"),
        (zstd_file(header(4, 1, 1), STREAMS, table=[(2**63, 9)] * 6), "the file ends in this"),
        (GOOD[:16] + struct.pack("<I", 2**31) + GOOD[20:], "table at 2147483648"),
        (GOOD[:16] + struct.pack("<I", 8) + GOOD[20:], "table at 8"),
        (GOOD + b"x", "1 bytes follow the last stream"),
        (GOOD[:-HARMONICS_FRAME] + bytes(HARMONICS_FRAME), "harmonics: damaged Zstandard frame"),
    ],
)  # fmt: skip
def test_damaged_files(tmp_path: Path, content: bytes, message: str) -> None:
    assert message in error_of(written(tmp_path / "bad.spz", content))


def bombs() -> list[Any]:
    size = 50_000_000
    head = struct.pack("<4sIIBBBB", b"NGSP", 3, size, 3, 12, 0, 0)
    frame = zstd.compress(bytes(1 << 20))
    frames = [frame] * 6
    sizes = [width * size for width in (9, 1, 3, 3, 4, 45)]
    four = header(4, size, 3)[:15] + struct.pack("<BI12x", 6, 32)
    table = b"".join(struct.pack("<QQ", len(frame), full) for full in sizes)
    small = header(4, 1, 0)[:15] + struct.pack("<BI12x", 5, 32)
    few = b"".join(struct.pack("<QQ", len(frame), full) for full in (9, 1, 3, 3, 4))
    return [
        pytest.param(gzip_file(head, bytes(1 << 20)), "take 3250000000 bytes", id="gzip"),
        pytest.param(four + table + b"".join(frames), "take 3250000000 bytes", id="zstd"),
        pytest.param(small + few + frame * 5, "the stream does not have 9 bytes", id="frame"),
        pytest.param(
            gzip_file(header(3, 1, 0), *STREAMS[:5], bytes(200 << 20)), "does not end", id="tail"
        ),
    ]


@pytest.mark.parametrize(("content", "message"), bombs())
def test_bombs_take_no_memory(tmp_path: Path, content: bytes, message: str) -> None:
    path = written(tmp_path / "bomb.spz", content)
    tracemalloc.start()
    found = error_of(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert message in found
    assert peak < 4 * len(content) + 4e6


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none\.spz"):
        read_spz(tmp_path / "none.spz")
    assert error_of(Path("/dev/zero")) == "it is not a file"
    assert error_of(tmp_path) == "it is not a file"


def test_a_version_that_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="version: expected 3 or 4, got 2"):
        write_spz(float_map(1), tmp_path / "a.spz", 2)


def test_half_precision_centres_may_be_infinite(tmp_path: Path) -> None:
    infinite = np.array([np.inf, 0, 0], "<f2").tobytes()
    content = gzip_file(header(1, 1, 0), infinite, ALPHA, COLOR, SCALE, ROTATION[:3])
    assert "means" in error_of(written(tmp_path / "a.spz", content))


@given(data=st.data())
def test_damaged_file_gives_a_map_or_one_line(tmp_path_factory: Any, data: st.DataObject) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.spz"
    version = data.draw(st.sampled_from([3, 4]))
    write_spz(float_map(3, sh_degree=1), path, version)
    assert_map_or_one_line(path, data, read_spz)


def test_truncated_file(tmp_path: Path) -> None:
    for version in (3, 4):
        write_spz(float_map(20, sh_degree=1), tmp_path / "a.spz", version)
        content = (tmp_path / "a.spz").read_bytes()
        for length in range(0, len(content), 5):
            error_of(written(tmp_path / "cut.spz", content[:length]))
