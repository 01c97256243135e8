"""Large maps are read from the store in blocks: to the same bits, as far as they are asked for."""

import sqlite3
from contextlib import closing
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file
from scenes import image_bytes, in_clusters, orbit_camera
from store_maps import ROOM, assert_same, blobs_of, edited, random_map

import gslts
from gslts._core.map import CHUNK_SIZE
from gslts.core.edited_map import remove_from_id
from gslts.core.gaussian_map import MIN_BOUNDED, GaussianMap
from gslts.rendering.rasterizer import rows_in_view
from gslts.store.causes import UpdateCause
from gslts.store.delta import apply_deltas, compute_delta
from gslts.store.map_store import INDEX, MapStore
from gslts.store.records import Snapshot
from gslts.store.snapshot import open_snapshot

CAMERA = orbit_camera(angle_rad=2)


def clusters(size: int = MIN_BOUNDED + 1000) -> GaussianMap:
    """Return clusters of small Gaussians, most of them out of view of the camera."""
    return in_clusters(random_map(size))


@pytest.fixture(scope="module")
def large() -> GaussianMap:
    return clusters()


@pytest.fixture
def folder(tmp_path: Path, large: GaussianMap) -> Path:
    """Return the folder of a large map with one version."""
    MapStore.create(tmp_path, large, ROOM)
    return tmp_path


def read(folder: Path, number: int | None = None) -> GaussianMap:
    with MapStore(folder) as store:
        return store.read(number)


def loaded_chunks(gaussian_map: GaussianMap) -> int:
    memory = gaussian_map._memory
    assert memory is not None
    return int((~memory._common._missing).sum())


def damage(folder: Path, row: int) -> Path:
    """Change a bit of the colours of a Gaussian in the only file; return its path."""
    (path,) = blobs_of(folder)
    content = bytearray(path.read_bytes())
    colors = load_file(path)["sh"]
    start = content.find(colors.tobytes())
    content[start + row * colors[0].nbytes] ^= 1
    path.write_bytes(bytes(content))
    return path


def test_what_is_in_view_is_read_and_renders_to_the_same_bits(
    folder: Path, large: GaussianMap
) -> None:
    stored = read(folder)
    assert (stored.size, stored.sh_degree, stored.feature_dims) == (large.size, 1, 2)
    assert stored.next_id == large.next_id
    assert loaded_chunks(stored) == 0
    rows = rows_in_view(stored, [CAMERA])
    np.testing.assert_array_equal(rows, rows_in_view(large, [CAMERA]))
    assert loaded_chunks(stored) == 0
    expected = gslts.render(large, CAMERA)
    assert image_bytes(gslts.render(stored, CAMERA)) == image_bytes(expected)
    assert loaded_chunks(stored) == len(np.unique(rows // CHUNK_SIZE)) < large.size // CHUNK_SIZE
    assert_same(stored.select(rows), large.select(rows))
    np.testing.assert_array_equal(stored.centers(rows), large.centers(rows))
    assert_same(stored, large)


def test_a_map_without_its_newest_gaussians_is_not_read(folder: Path, large: GaussianMap) -> None:
    stored = read(folder)
    first_id = int(large.next_id) - 700
    older = remove_from_id(stored, first_id)
    assert loaded_chunks(stored) == 0
    expected = remove_from_id(large, first_id)
    assert image_bytes(gslts.render(older, CAMERA)) == image_bytes(gslts.render(expected, CAMERA))
    assert_same(older, expected)
    assert (older.size, older.ids.max()) == (large.size - 700, first_id - 1)
    assert remove_from_id(stored, stored.next_id).size == large.size


def test_other_features_of_what_is_read(folder: Path, large: GaussianMap) -> None:
    def of(ids: np.ndarray) -> np.ndarray:
        return np.stack([ids % 7, ids % 2], axis=1).astype(np.float32)

    drawn = read(folder).with_features(of)
    images = gslts.render(drawn, CAMERA)
    assert 0 < loaded_chunks(drawn) < large.size // CHUNK_SIZE
    assert image_bytes(images) == image_bytes(gslts.render(large.with_features(of), CAMERA))
    assert_same(drawn, large.with_features(of))


def test_arrays_as_a_whole_are_those_of_the_map(folder: Path, large: GaussianMap) -> None:
    stored = read(folder)
    assert_same(
        replace(stored, features=large.features + 1), replace(large, features=large.features + 1)
    )
    assert_same(read(folder).astype(np.float64), large.astype(np.float64))
    with pytest.raises(AttributeError, match="no attribute mean"):
        _ = stored.mean  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match="read-only"):
        stored.means[0] = 0
    with pytest.raises(IndexError):
        stored.select(np.array([large.size]))
    assert_same(stored.select(np.array([-1, 3])), large.select(np.array([-1, 3])))


@pytest.mark.parametrize("seed", [1, 2])
def test_later_versions_are_read_in_blocks(folder: Path, large: GaussianMap, seed: int) -> None:
    rng = np.random.default_rng(seed)
    maps = [large]
    with MapStore(folder, writable=True) as store:
        for number in range(3):
            near = np.flatnonzero(rng.random(maps[-1].size) < 0.001)
            near = near[near < 3 * CHUNK_SIZE] if number else near
            keep = np.ones(maps[-1].size, np.bool_)
            keep[near] = False
            part = edited(maps[-1].select(near), number, store.version().next_id)
            old = part.ids < store.version().next_id
            both = np.isin(maps[-1].ids, part.ids[old])
            arrays = {}
            for name in (
                "means",
                "quats",
                "log_scales",
                "logit_opacities",
                "sh",
                "features",
                "ids",
            ):
                array = getattr(maps[-1], name).copy()
                array[both] = getattr(part, name)[old]
                arrays[name] = np.concatenate([array[keep | both], getattr(part, name)[~old]])
            maps.append(GaussianMap(**arrays, origin=large.origin))
            store.commit(compute_delta(maps[-2], maps[-1]), UpdateCause())
    for number, expected in enumerate(maps, start=1):
        stored = read(folder, number)
        assert loaded_chunks(stored) == 0
        assert image_bytes(gslts.render(stored, CAMERA)) == image_bytes(
            gslts.render(expected, CAMERA)
        )
        assert stored.next_id == expected.next_id
        ids = np.arange(0, expected.next_id + 5, 3, dtype=np.uint64)
        np.testing.assert_array_equal(stored.has_ids(ids), expected.has_ids(ids))
        rows = rng.integers(0, expected.size, 50)
        assert_same(stored.select(np.unique(rows)), expected.select(np.unique(rows)))
        assert_same(stored, expected)
    in_memory = read(folder, 1)
    for before, after in pairwise(maps):
        in_memory = apply_deltas(in_memory, [compute_delta(before, after)])
    assert loaded_chunks(in_memory) == 0
    assert_same(in_memory, maps[-1])
    with MapStore(folder, writable=True) as store:
        store.compact(1)
    assert_same(read(folder), maps[-1])


def test_a_map_stays_readable_when_its_file_is_removed(folder: Path, large: GaussianMap) -> None:
    stored = read(folder)
    blobs_of(folder)[0].unlink()
    assert_same(stored, large)
    with pytest.raises(FileNotFoundError, match="missing; copy it from a backup"):
        read(folder)


def test_a_damaged_block_is_named_when_it_is_touched(folder: Path, large: GaussianMap) -> None:
    hidden = np.setdiff1d(np.arange(large.size), rows_in_view(large, [CAMERA]))[0]
    path = damage(folder, int(hidden))
    count = -(-large.size // CHUNK_SIZE)
    block = f"block {hidden // CHUNK_SIZE + 1} of {count} is damaged: its checksum does not match"
    stored = read(folder)
    gslts.render(stored, CAMERA)  # Shows other blocks.
    with pytest.raises(ValueError, match=f"version 1: {path}: {block}; copy it"):
        stored.select(np.array([hidden]))
    with pytest.raises(ValueError, match=block):
        _ = stored.means
    with MapStore(folder) as store:
        (problem,) = store.find_problems()
    assert problem.startswith(f"version 1: {path}: {block}")
    with MapStore(folder, writable=True) as store, pytest.raises(ValueError, match=block):
        store.restore(1)


def test_a_damaged_block_in_view_ends_the_rendering(folder: Path, large: GaussianMap) -> None:
    damage(folder, int(rows_in_view(large, [CAMERA])[0]))
    with pytest.raises(ValueError, match=r"version 1: .* block \d+ of \d+ is damaged"):
        gslts.render(read(folder), CAMERA)


@pytest.mark.parametrize("harm", ["cut", "grow", "head", "header", "long", "index"])
def test_a_file_with_a_damaged_head_is_not_opened(folder: Path, harm: str) -> None:
    (path,) = blobs_of(folder)
    content = bytearray(path.read_bytes())
    if harm == "cut":
        del content[-1:]
    elif harm == "grow":
        content += b"x"
    elif harm == "head":
        content[2000] ^= 1
    elif harm == "header":
        content[30] ^= 1
    elif harm == "long":
        content[7] = 127
    path.write_bytes(bytes(content))
    if harm == "index":
        with closing(sqlite3.connect(folder / INDEX)) as index, index:
            index.execute("UPDATE snapshots SET head = ?", (64 * "0",))
    with pytest.raises(ValueError, match=f"version 1: {path}: its head is damaged"):
        read(folder)
    with MapStore(folder) as store:
        problems = store.find_problems()
    assert len(problems) == 1
    assert path.name in problems[0]


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"[]",
        b"{}",
        b'{"means": []}',
        b'{"means": {"dtype": "F32", "shape": []}}',
        b'{"means": {"dtype": "F32", "shape": [-5]}}',
        b'{"means": {"dtype": "F32", "shape": ["a", 1000000000000000]}}',
        b'{"means": {"dtype": "F32", "shape": [1e200, 1%s]}}' % (400 * b"0"),
    ],
)
def test_a_head_of_a_hostile_writer_is_damaged(tmp_path: Path, text: bytes) -> None:
    content = len(text).to_bytes(8, "little") + text
    (tmp_path / "file").write_bytes(content)
    snapshot = Snapshot(key=64 * "0", size=len(content), head=64 * "0")
    with pytest.raises(ValueError, match=r"version 1: its head is damaged: .*; copy it") as caught:
        open_snapshot(tmp_path / "file", snapshot, "version 1")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_cut_while_it_is_read_is_damaged(folder: Path) -> None:
    stored = read(folder)
    (path,) = blobs_of(folder)
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size // 2)
    with pytest.raises(ValueError, match=r"block \d+ of \d+ is damaged"):
        _ = stored.means


def test_snapshots_of_an_older_gslts_are_read_as_a_whole(folder: Path, large: GaussianMap) -> None:
    with closing(sqlite3.connect(folder / INDEX)) as index, index:
        index.execute("ALTER TABLE snapshots DROP COLUMN head")
        index.execute("PRAGMA user_version = 5")
    assert read(folder)._memory is None
    assert_same(read(folder), large)


def test_snapshots_are_safetensors_files(folder: Path, large: GaussianMap) -> None:
    (path,) = blobs_of(folder)
    np.testing.assert_array_equal(load_file(path)["means"], large.means)
