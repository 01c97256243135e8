"""Versions of a map: bit-identical reading, atomic commits, damage and garbage."""

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from store_maps import (
    BOX,
    ORACLE,
    REJECTED,
    ROOM,
    addition,
    assert_same,
    blobs_of,
    edited,
    grown,
    random_map,
)

from gslts.mapping.density.control import join
from gslts.store.blobs import Blobs
from gslts.store.causes import UpdateCause
from gslts.store.delta import apply_deltas, compare_by_ids, compute_delta
from gslts.store.map_store import INDEX, MapStore
from gslts.store.records import Blob, Event, ObjectEvent


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder of a map with one version."""
    MapStore.create(tmp_path, random_map(100), ROOM)
    return tmp_path


def test_every_version_is_read_bit_identically(folder: Path) -> None:
    maps = grown(folder, 12)
    with MapStore(folder) as store:
        assert [version.number for version in store.versions()] == list(range(1, 14))
        for number, expected in enumerate(maps, start=1):
            assert_same(store.read(number), expected)
            assert store.version(number).gaussians == expected.size
        assert_same(store.read(), maps[-1])
        assert store.version().cause == UpdateCause(round=12)


def test_applying_a_delta_gives_the_next_map() -> None:
    before = random_map(50)
    after = edited(before, 1, 50)
    delta = compute_delta(before, after)
    assert delta.touched == len(delta.removed) + delta.added.size + delta.changed.size
    assert 0 < delta.changed.size < 20
    assert_same(apply_deltas(before, [delta]), after)
    nothing = compute_delta(before, before)
    assert nothing.touched == 0
    assert_same(apply_deltas(before, [nothing]), before)


def test_negative_zero_differs_from_zero() -> None:
    before = replace(random_map(3), logit_opacities=np.zeros(3, np.float32))
    after = replace(before, logit_opacities=-before.logit_opacities)
    assert compute_delta(before, after).changed.size == 3


def test_a_map_can_become_empty_and_grow_again(folder: Path) -> None:
    with MapStore(folder, writable=True) as store:
        first = store.read()
        empty = first.select(np.zeros(0, np.int64))
        store.commit(empty, UpdateCause())
        again = join(empty, random_map(5), store.version().next_id)
        store.commit(again, UpdateCause())
        assert_same(store.read(2), empty)
        assert_same(store.read(3), again)
        assert int(again.ids[0]) == 100, "ids of removed Gaussians are not reused"


def test_restoring_adds_a_version(folder: Path) -> None:
    maps = grown(folder, 3)
    with MapStore(folder, writable=True) as store:
        version = store.restore(2)
        assert (version.number, version.kind) == (5, "restore")
        assert_same(store.read(), maps[1])
        after = edited(maps[1], 9, store.version().next_id)
        store.commit(after, UpdateCause())
        assert_same(store.read(6), after)
        assert_same(store.read(4), maps[3])
        found = compare_by_ids(store.read(6), store.read(4))
    assert_same(maps[3].select(np.isin(maps[3].ids, found.added.ids)), found.added)


def test_features_of_another_length_are_committed(folder: Path) -> None:
    maps = grown(folder, 2)
    embedded = replace(maps[-1], features=np.ones((maps[-1].size, 5), np.float32))
    with MapStore(folder, writable=True) as store:
        version = store.commit_features(embedded, ORACLE)
        assert (version.kind, version.parent, version.touched) == ("semantics", 3, embedded.size)
        assert_same(store.read(), embedded)
        assert_same(store.read(3), maps[-1])
        later = embedded.select(np.arange(20))
        store.commit(later, UpdateCause())
        assert_same(store.read(), later)
        assert compare_by_ids(store.read(3), store.read(4)).changed.size == embedded.size
        assert [version.number for version in store.lineage()] == [1, 2, 3, 4, 5]
        with pytest.raises(ValueError, match="means are not those of version 5"):
            store.commit_features(replace(later, means=later.means + 1), ORACLE)
        store.compact(1)
        assert_same(store.read(), later)
        assert store.find_problems() == []


def test_used_ids_are_rejected(folder: Path) -> None:
    maps = grown(folder, 1)
    with MapStore(folder, writable=True) as store:
        store.restore(1)
        with pytest.raises(ValueError, match="must be 107 or higher, got 100"):
            store.commit(edited(maps[0], 2, 100), UpdateCause())
        assert store.version().number == 3


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda given: given.select(np.arange(given.size)[::-1]), "ids must rise"),
        (lambda given: replace(given, origin=np.zeros(3)), "different origins"),
        (lambda given: replace(given, sh=given.sh[:, :1]), "sh_degree was 1 and is 0"),
        (lambda given: given.astype(np.float64), "dtype was float32 and is float64"),
    ],
)
def test_another_map_is_rejected(folder: Path, edit: object, message: str) -> None:
    with MapStore(folder, writable=True) as store:
        with pytest.raises(ValueError, match=message):
            store.commit(edit(store.read()), UpdateCause())  # type: ignore[operator]
        assert len(store.versions()) == 1


def test_object_changes_are_recorded(folder: Path) -> None:
    book = ObjectEvent(kind="removal", type="Book", boxes=(BOX, None))
    events = [addition("Mug"), book]
    with MapStore(folder, writable=True) as store:
        store.commit(store.read(), UpdateCause(), events)
        assert [event.type for event in store.events()] == ["Mug", "Book"]
        assert store.events()[0] == Event(version=2, **addition("Mug").model_dump())


def test_readers_and_one_writer_work_at_the_same_time(folder: Path) -> None:
    with MapStore(folder) as reader, MapStore(folder, writable=True) as writer:
        before = reader.read()
        writer.commit(edited(before, 1, 100), UpdateCause())
        assert_same(reader.read(1), before)
        assert reader.version().number == 2


def test_a_version_is_read_while_the_store_is_compacted(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    maps = grown(folder, 4)
    read = Blobs.read
    with MapStore(folder) as reader:

        def compacted_first(self: Blobs, blob: Blob) -> dict[str, np.ndarray]:
            monkeypatch.setattr(Blobs, "read", read)
            with MapStore(folder, writable=True) as writer:
                writer.compact(1)
            return read(self, blob)

        monkeypatch.setattr(Blobs, "read", compacted_first)
        assert_same(reader.read(5), maps[-1])

        def compacted_then(self: Blobs, blob: Blob) -> None:
            monkeypatch.setattr(Blobs, "verify", verify)
            with MapStore(folder, writable=True) as writer:
                writer.commit(edited(maps[-1], 9, writer.version().next_id), UpdateCause())
                writer.compact(1)
            verify(self, blob)

        verify = Blobs.verify
        monkeypatch.setattr(Blobs, "verify", compacted_then)
        assert reader.find_problems() == []


@pytest.mark.parametrize("loss", ["file", "name"])
def test_garbage_is_kept_if_a_file_is_missing(folder: Path, loss: str) -> None:
    """Any file may be the one that a damaged index means."""
    grown(folder, 1)
    with MapStore(folder) as store:
        delta = store.version(2).delta
        assert delta is not None
    if loss == "file":
        next(path for path in blobs_of(folder) if path.stem == delta.key).unlink()
    else:
        other = ("0" if delta.key[0] != "0" else "1") + delta.key[1:]
        with closing(sqlite3.connect(folder / INDEX)) as index, index:
            index.execute("UPDATE versions SET delta = ? WHERE number = 2", (other,))
    before = blobs_of(folder)
    with (
        MapStore(folder, writable=True) as store,
        pytest.raises(ValueError, match=r"1 file\(s\) of its versions are missing; nothing was"),
    ):
        store.collect_garbage()
    assert blobs_of(folder) == before


@pytest.mark.parametrize(
    "harm",
    [
        "UPDATE versions SET parent = 2 WHERE number = 2",
        "UPDATE versions SET time_s = 1e300",
        "UPDATE versions SET cause = '[]'",
        "UPDATE versions SET cause = json_set(cause, '$.kind', 'apdate')",
        "UPDATE versions SET cause = json_set(cause, '$.mood', 'good')",
        "UPDATE rejections SET cause = json_set(cause, '$.record.rejected', NULL)",
        f"UPDATE versions SET cause = '{'[' * 100_000}'",
        "UPDATE events SET kind = 'edition'",
        "UPDATE events SET boxes = '[null, [[0, 0, 0]]]'",
        "UPDATE events SET boxes = '7'",
        "UPDATE rejections SET time_s = -1",
    ],
)
def test_invalid_values_in_the_index_are_damage(folder: Path, harm: str) -> None:
    with MapStore(folder, writable=True) as store:
        store.commit(store.read(), UpdateCause(), [addition("Mug")])
        store.add_rejection(REJECTED)
    with closing(sqlite3.connect(folder / INDEX)) as index, index:
        index.execute(harm)
    with (
        MapStore(folder) as store,
        pytest.raises(ValueError, match=r"versions\.sqlite: damaged: .*from a backup"),
    ):
        store.versions(), store.events(), store.rejections()


@pytest.mark.parametrize("harm", ["flip", "cut", "grow", "delete"])
def test_a_damaged_file_is_named_and_other_versions_stay_readable(folder: Path, harm: str) -> None:
    maps = grown(folder, 1)
    with MapStore(folder) as store:
        delta = store.version(2).delta
        assert delta is not None
    path = next(blob for blob in blobs_of(folder) if blob.stem == delta.key)
    content = bytearray(path.read_bytes())
    if harm == "flip":
        content[len(content) // 2] ^= 1
    elif harm == "cut":
        del content[-1:]
    elif harm == "grow":
        content += b"x"
    path.write_bytes(bytes(content))
    if harm == "delete":
        path.unlink()
    with MapStore(folder) as store:
        (problem,) = store.find_problems()
        assert problem.startswith("version 2: ")
        assert path.name in problem
        with pytest.raises((OSError, ValueError), match=path.name):
            store.read(2)
        assert_same(store.read(1), maps[0])
    with MapStore(folder, writable=True) as store:
        store.restore(1)
        assert_same(store.read(), maps[0])


@pytest.mark.parametrize(
    "content", [b"", b"garbage" * 10, b"\x02\0\0\0\0\0\0\0[]", b"\x02\0\0\0\0\0\0\0{}1"]
)
def test_a_file_without_arrays_is_named(tmp_path: Path, content: bytes) -> None:
    blobs = Blobs(tmp_path)
    blob = blobs.write_parts([content])
    with pytest.raises(ValueError, match=rf"{blob.key}\.safetensors: no arrays: .*; copy it"):
        blobs.read(blob)


def test_an_intact_store_has_no_problem(folder: Path) -> None:
    grown(folder, 3)
    seen: list[int] = []
    with MapStore(folder) as store:
        assert store.find_problems(lambda: seen.append(1)) == []
    assert len(seen) == 4


def test_a_newer_schema_is_named(folder: Path) -> None:
    connection = sqlite3.connect(folder / INDEX)
    connection.execute("PRAGMA user_version = 99")
    connection.close()
    with pytest.raises(ValueError, match=f"{INDEX}: its schema is version 99, this gslts reads 7"):
        MapStore(folder)


def test_an_older_schema_is_read_and_becomes_new_when_written(folder: Path) -> None:
    def schema() -> int:
        connection = sqlite3.connect(folder / INDEX)
        number = connection.execute("PRAGMA user_version").fetchone()[0]
        connection.close()
        return int(number)

    connection = sqlite3.connect(folder / INDEX)
    connection.execute("PRAGMA user_version = 2")
    for table, column in (
        ("events", "motion"),
        ("versions", "robot"),
        ("rejections", "robot"),
        ("snapshots", "head"),
    ):
        connection.execute(f"ALTER TABLE {table} DROP COLUMN {column}")
    connection.execute("INSERT INTO events VALUES (1, 'removal', 'Mug', '[null, null]')")
    connection.commit()
    connection.close()
    mug = Event(version=1, kind="removal", type="Mug", boxes=(None, None))
    with MapStore(folder) as store:
        assert (store.version().number, store.version().robot) == (1, None)
        assert store.events() == [mug]
    assert schema() == 2
    pose = ((1.0, 0.0, 0.0, 0.1), (0.0, 1.0, 0.0, 0.2), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    shift = ObjectEvent(kind="shift", type="Chair", boxes=(BOX, BOX), motion=pose)
    with MapStore(folder, writable=True) as store:
        store.commit(store.read(), UpdateCause(), [shift])
        assert store.events() == [mug, Event(version=2, **dict(shift))]
    assert schema() == 7


@pytest.mark.parametrize("content", [b"", b"no database" * 100])
def test_another_file_is_rejected_as_index(folder: Path, content: bytes) -> None:
    (folder / INDEX).write_bytes(content)
    with pytest.raises(ValueError, match=INDEX):
        MapStore(folder)


def test_remains_of_an_interrupted_commit_are_removed(folder: Path) -> None:
    maps = grown(folder, 1)
    part = blobs_of(folder)[0].parent / ".abc.safetensors.1.part"
    part.write_bytes(b"half")
    with MapStore(folder, writable=True) as store:
        assert not part.exists()
        unknown = store._blobs.write({"x": np.zeros(9)})
        assert store.collect_garbage() == unknown.size
        assert unknown.key not in list(store._blobs)
        assert store.find_problems() == []
        assert_same(store.read(), maps[-1])


def test_compaction_keeps_the_records_of_old_versions(folder: Path) -> None:
    maps = grown(folder, 8)
    with MapStore(folder, writable=True) as store:
        store.restore(3)  # Version 10; its parent is compacted.
        before = store.versions()
        assert store.compact(3) > 0
        assert [version.model_copy(update={"delta": None}) for version in store.versions()] == [
            version.model_copy(update={"delta": None}) for version in before
        ]
        for number, expected in ((8, maps[7]), (9, maps[8]), (10, maps[2])):
            assert_same(store.read(number), expected)
        for number in range(1, 8):
            with pytest.raises(ValueError, match=rf"version {number} was compacted .* gslts log"):
                store.read(number)
        with pytest.raises(ValueError, match="version 2 was compacted"):
            store.restore(2)
        assert store.find_problems() == []
        assert store.compact(3) == 0
        store.commit(edited(store.read(), 99, store.version().next_id), UpdateCause())
        with pytest.raises(ValueError, match="keep must be positive"):
            store.compact(0)


def test_snapshots_bound_the_number_of_deltas(tmp_path: Path) -> None:
    MapStore.create(tmp_path, random_map(30), ROOM)
    maps = grown(tmp_path, 30)
    with MapStore(tmp_path) as store:
        snapshots = store._index.snapshots()
        lengths = [
            len(store._reconstruction(version.number, snapshots)[1]) for version in store.versions()
        ]
        assert max(lengths) < 12
        for number, expected in enumerate(maps, start=1):
            assert_same(store.read(number), expected)
    deltas = sum(
        version.delta.size for version in store_versions(tmp_path) if version.delta is not None
    )
    assert sum(blob.size for blob in snapshots.values()) < 2 * deltas


def store_versions(folder: Path) -> list:
    with MapStore(folder) as store:
        return store.versions()


def test_a_clock_that_goes_back_is_logged(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    grown(folder, 1)
    monkeypatch.setattr("time.time", lambda: 5.0)
    with MapStore(folder, writable=True) as store:
        assert store.restore(1).number == 3
    assert "s behind version 2" in caplog.text
