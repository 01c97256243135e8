"""Clones of one map exchange versions through a folder."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import synthetic_rooms
from store_maps import assert_same
from synthetic_rooms import extend_room, write_rooms

from gslts.cli.history import gc
from gslts.fleet.cache import _cache_folder, cached_clone
from gslts.fleet.exchange import clone_map, pull_map, push_map
from gslts.fleet.remote_store import version_name
from gslts.fleet.state import read_remote_state
from gslts.io.atomic_files import sync_folder
from gslts.store.causes import ConsolidationCause, ConsolidationRecord, UpdateCause
from gslts.store.history import INDEX
from gslts.store.manifest import update_image_path
from gslts.store.map_folder import open_map, read_map
from gslts.store.measurement_files import read_measurements
from gslts.store.records import Version

pytestmark = pytest.mark.usefixtures("url", "no_wait")


@pytest.fixture
def no_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ask again at once where a store may be late."""
    monkeypatch.setattr("gslts.fleet.remote_store.WAIT_S", 0.0)


@pytest.fixture
def url(tmp_path: Path) -> str:
    """Return the URL of a shared map of two rooms with clones `a` and `b` beside it."""
    write_rooms(tmp_path / "a")
    url = f"file://{tmp_path}/bucket"
    push_map(tmp_path / "a", url)
    clone_map(url, tmp_path / "b")
    return url


def change_room(folder: Path, room: int, number: int = 0, robot: str = "r1") -> Version:
    """Commit an update of a room by a robot."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GSLTS_ROBOT", robot)
        return synthetic_rooms.change_room(folder, room, number)


def versions_of(folder: Path) -> list[tuple[int, str | None, int | None]]:
    """Return number, robot and round of each version."""
    with open_map(folder) as store:
        assert store.find_problems() == []
        return [
            (v.number, v.robot, v.cause.round if isinstance(v.cause, UpdateCause) else None)
            for v in store.versions()
        ]


def test_a_clone_holds_the_same_bits(tmp_path: Path, url: str) -> None:
    change_room(tmp_path / "a", 0)
    push_map(tmp_path / "a")
    clone_map(url, tmp_path / "c")
    for number in (1, 2):
        assert_same(*(read_map(Path(f"{tmp_path / name}@{number}")) for name in "ac"))
    with open_map(tmp_path / "a") as first, open_map(tmp_path / "c") as other:
        assert first.versions() == other.versions()
        assert first.events() == other.events()
        assert first._index.snapshots() == other._index.snapshots()
    for name in ("manifest.json", "cameras.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "c" / name).read_bytes()


def test_two_commands_may_use_a_shared_map_for_the_first_time(
    tmp_path: Path, url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = _cache_folder(url)

    def be_slower(_: Path) -> None:
        monkeypatch.setattr("gslts.fleet.exchange.sync_folder", sync_folder)
        shutil.copytree(tmp_path / "b", folder)

    change_room(tmp_path / "a", 0)
    push_map(tmp_path / "a")
    monkeypatch.setattr("gslts.fleet.exchange.sync_folder", be_slower)
    assert cached_clone(url) == folder
    assert versions_of(folder) == versions_of(tmp_path / "a")
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]


@pytest.mark.parametrize("name", ["manifest.json", "remote.json"])
def test_files_of_a_clone_that_are_too_large_are_named(tmp_path: Path, name: str) -> None:
    with (tmp_path / "b" / name).open("ab") as file:
        file.truncate(1 << 30)
    with pytest.raises(ValueError, match=rf"{name}: larger than [\d,]+ bytes$"):
        pull_map(tmp_path / "b")


def test_who_comes_second_follows(tmp_path: Path) -> None:
    change_room(tmp_path / "a", 0, number=1, robot="r1")
    change_room(tmp_path / "b", 1, number=2, robot="r2")
    change_room(tmp_path / "b", 1, number=3, robot="r2")
    assert push_map(tmp_path / "a").pushed == 1
    done = push_map(tmp_path / "b")
    assert (done.pulled, done.pushed, done.replayed, done.given_up) == (1, 2, 2, ())
    assert pull_map(tmp_path / "a").pulled == 2
    expected = [(2, "r1", 1), (3, "r2", 2), (4, "r2", 3)]
    assert versions_of(tmp_path / "a")[1:] == versions_of(tmp_path / "b")[1:] == expected
    assert_same(read_map(tmp_path / "a"), read_map(tmp_path / "b"))


def test_a_change_elsewhere_is_bit_identical_to_having_been_second(
    tmp_path: Path, url: str
) -> None:
    change_room(tmp_path / "b", 1, number=2)
    change_room(tmp_path / "a", 0, number=1)
    push_map(tmp_path / "a")
    clone_map(url, tmp_path / "second")
    second = change_room(tmp_path / "second", 1, number=2)
    push_map(tmp_path / "b")
    assert_same(read_map(tmp_path / "b"), read_map(tmp_path / "second"))
    with open_map(tmp_path / "b") as store:
        assert store.version().model_copy(update={"time_s": second.time_s}) == second
        assert [event.version for event in store.events()] == [2, 3]


def test_measurements_of_an_extension_follow_with_its_gaussians(tmp_path: Path, url: str) -> None:
    extend_room(tmp_path / "b", 1)
    change_room(tmp_path / "a", 0)
    push_map(tmp_path / "a")
    assert push_map(tmp_path / "b").replayed == 1
    clone_map(url, tmp_path / "c")
    for name in "bc":
        before, after = (read_map(Path(f"{tmp_path / name}@{number}")) for number in (2, 3))
        new = np.setdiff1d(after.ids, before.ids)
        np.testing.assert_array_equal(read_measurements(tmp_path / name).ids, new)
    assert read_measurements(tmp_path / "a").ids.size == 0


def test_a_change_of_the_same_region_is_not_applied_blindly(tmp_path: Path) -> None:
    change_room(tmp_path / "b", 0, number=2, robot="r2")
    change_room(tmp_path / "a", 0, number=1, robot="r1")
    push_map(tmp_path / "a")
    done = push_map(tmp_path / "b")
    assert (done.pushed, done.replayed) == (0, 0)
    assert done.given_up == ("version 2 of r1 changed the same region; observe it again",)
    assert_same(read_map(tmp_path / "a"), read_map(tmp_path / "b"))
    with open_map(tmp_path / "b") as store:
        (rejection,) = store.rejections()
    assert (rejection.version, rejection.robot, rejection.cause.round) == (2, "r2", 2)
    # Others hear of it with the next version.
    change_room(tmp_path / "b", 1, number=3, robot="r2")
    push_map(tmp_path / "b")
    pull_map(tmp_path / "a")
    with open_map(tmp_path / "a") as store:
        assert store.rejections() == [rejection]


def test_what_follows_a_given_up_version_is_kept_where_it_is_elsewhere(tmp_path: Path) -> None:
    change_room(tmp_path / "b", 0, number=2)
    change_room(tmp_path / "b", 1, number=3)
    change_room(tmp_path / "b", 0, number=4)  # Changes what the first one added.
    change_room(tmp_path / "a", 0, number=1)
    push_map(tmp_path / "a")
    done = push_map(tmp_path / "b")
    assert (done.pushed, len(done.given_up)) == (1, 2)
    assert [round_ for _, _, round_ in versions_of(tmp_path / "b")] == [None, 1, 3]


def test_a_restored_version_is_given_up_if_others_changed_the_map(tmp_path: Path) -> None:
    change_room(tmp_path / "a", 0, number=1)
    push_map(tmp_path / "a")
    pull_map(tmp_path / "b")
    with open_map(tmp_path / "b", writable=True) as store:
        store.restore(1)
    change_room(tmp_path / "a", 1, number=2)
    push_map(tmp_path / "a")
    done = push_map(tmp_path / "b")
    assert done.given_up == ("others changed the map before; run gslts restore again",)
    with open_map(tmp_path / "b", writable=True) as store:
        store.restore(1)
    push_map(tmp_path / "b")
    pull_map(tmp_path / "a")
    assert_same(read_map(tmp_path / "a"), read_map(Path(f"{tmp_path}/a@1")))


def test_a_consolidation_is_given_up_if_others_changed_the_map(tmp_path: Path) -> None:
    record = ConsolidationRecord(
        views=1,
        held_out=1,
        refined=1,
        removed=0,
        iterations=1,
        psnr_before_db=20,
        psnr_after_db=21,
        seconds={},
    )
    with open_map(tmp_path / "b", writable=True) as store:
        store.commit(store.read(), ConsolidationCause(since=1, record=record, frames=()))
    change_room(tmp_path / "b", 1, number=1)
    change_room(tmp_path / "a", 0, number=2)
    push_map(tmp_path / "a")
    done = push_map(tmp_path / "b")
    assert done.given_up == ("others changed the map before; run gslts consolidate again",)
    assert (done.pushed, done.replayed) == (1, 1)


def test_an_exchange_that_was_interrupted_goes_on(tmp_path: Path) -> None:
    """A robot that was killed after a version object was created does not know it."""
    state = (tmp_path / "b" / "remote.json").read_bytes()
    change_room(tmp_path / "b", 0, number=1)
    push_map(tmp_path / "b")
    (tmp_path / "b" / "remote.json").write_bytes(state)
    change_room(tmp_path / "b", 0, number=2)
    assert push_map(tmp_path / "b").pushed == 1
    assert [round_ for _, _, round_ in versions_of(tmp_path / "b")] == [None, 1, 2]


def test_a_map_goes_to_a_second_bucket(tmp_path: Path, url: str) -> None:
    change_room(tmp_path / "a", 0, number=1)
    other = f"file://{tmp_path}/other"
    assert push_map(tmp_path / "a", other).pushed == 2
    state = read_remote_state(tmp_path / "a")
    assert state is not None
    assert (state.url, state.number) == (other, 2)
    assert push_map(tmp_path / "a", url).pushed == 1


def test_another_map_is_rejected(tmp_path: Path, url: str) -> None:
    write_rooms(tmp_path / "foreign")
    before = sorted(path for path in tmp_path.rglob("*"))
    for exchange in (push_map, pull_map):
        with pytest.raises(ValueError, match="it holds another map; choose another URL"):
            exchange(tmp_path / "foreign", url)
    after = {path.name for path in set(tmp_path.rglob("*")) - set(before)}
    assert after <= {"writer.lock", f"{INDEX}-wal", f"{INDEX}-shm"}


def test_versions_that_were_not_pushed_are_not_compacted(tmp_path: Path, url: str) -> None:
    change_room(tmp_path / "b", 1, number=1)
    change_room(tmp_path / "b", 1, number=2)
    gc(tmp_path / "b", keep=1)
    change_room(tmp_path / "a", 0, number=3)
    push_map(tmp_path / "a")
    assert push_map(tmp_path / "b").replayed == 2
    gc(tmp_path / "b", keep=1)
    clone_map(url, tmp_path / "c")
    assert_same(read_map(tmp_path / "b"), read_map(tmp_path / "c"))
    with pytest.raises(ValueError, match="version 3 was compacted"):
        read_map(Path(f"{tmp_path / 'b'}@3"))


def test_images_follow_their_versions(tmp_path: Path, url: str) -> None:
    for name, room in (("a", 0), ("b", 1)):
        change_room(tmp_path / name, room)
        image = update_image_path(tmp_path / name, 2)
        image.parent.mkdir()
        image.write_text(name)
    push_map(tmp_path / "a")
    damage(tmp_path, "wrong count")
    with pytest.raises(ValueError, match="nothing was pulled"):
        pull_map(tmp_path / "b")
    assert update_image_path(tmp_path / "b", 2).read_text() == "b"
    update_image_path(tmp_path / "b", 2).unlink()
    with pytest.raises(ValueError, match="nothing was pulled"):
        pull_map(tmp_path / "b")
    assert not update_image_path(tmp_path / "b", 2).exists()
    update_image_path(tmp_path / "b", 2).write_text("b")
    push_map(tmp_path / "a", f"{url}2")
    push_map(tmp_path / "b", f"{url}2")
    clone_map(f"{url}2", tmp_path / "c")
    for name in "bc":
        texts = [update_image_path(tmp_path / name, number).read_text() for number in (2, 3)]
        assert texts == ["a", "b"]


def damage(tmp_path: Path, kind: str) -> None:
    """Damage what the bucket holds of version 2."""
    version = tmp_path / "bucket" / "versions" / "00000002.json"
    content = json.loads(version.read_text())
    key = content["version"]["delta"]["key"]
    blob = tmp_path / "bucket" / "blobs" / key[:2] / key
    if kind == "tampered blob":
        blob.write_bytes(blob.read_bytes()[:-1] + b"x")
    elif kind == "missing blob":
        blob.unlink()
    elif kind == "newer format":
        version.write_text(json.dumps({**content, "format_version": 2}))
    elif kind == "other history":
        version.write_text(json.dumps({**content, "previous": 64 * "0"}))
    elif kind == "hostile path":
        content["version"]["delta"]["key"] = "../../../etc/passwd"
        version.write_text(json.dumps(content))
    elif kind == "other cameras":
        content["files"] = {"cameras": content["version"]["delta"]}
        version.write_text(json.dumps(content))
    elif kind == "terminal codes":
        content["version"]["cause"]["config"] = {"x": [{"y": "\x1b[2J"}]}
        version.write_text(json.dumps(content))
    elif kind == "wrong count":
        content["version"]["gaussians"] += 1
        version.write_text(json.dumps(content))
    else:
        version.write_text("{")


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("tampered blob", "damaged: its checksum does not match its name"),
        ("missing blob", "missing; push it again"),
        ("newer format", "its format is version 2, this gslts reads 1; a newer gslts wrote it"),
        ("other history", "version 2 is not the one that came before"),
        ("hostile path", "version.delta.key: String should match pattern"),
        ("other cameras", "later versions do not change those of the first one"),
        ("terminal codes", "a text has control characters"),
        ("wrong count", "has not the number of Gaussians that it tells; nothing was pulled"),
        ("no JSON", "00000002.json: not a version of a shared map"),
    ],
)
def test_a_damaged_bucket_changes_nothing(
    tmp_path: Path, url: str, kind: str, message: str
) -> None:
    change_room(tmp_path / "a", 0)
    push_map(tmp_path / "a")
    change_room(tmp_path / "b", 1)
    damage(tmp_path, kind)
    before = versions_of(tmp_path / "b")
    for exchange in (pull_map, push_map):
        with pytest.raises((OSError, ValueError), match=message):
            exchange(tmp_path / "b")
    with pytest.raises((OSError, ValueError), match=message):
        clone_map(url, tmp_path / "c")
    assert versions_of(tmp_path / "b") == before
    assert not (tmp_path / "c").exists()
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("removed", [1, 2, 3])
def test_a_version_that_was_removed_from_the_bucket_is_named(
    tmp_path: Path, url: str, removed: int
) -> None:
    """New clones stop at it; a clone that has it heals the map under another URL."""
    for number in (2, 3, 4):
        change_room(tmp_path / "a", 0, number)
    push_map(tmp_path / "a")
    (tmp_path / "bucket" / version_name(removed)).unlink()
    message = f"version {removed} is missing, but version {removed + 1} is there"
    with pytest.raises(FileNotFoundError, match=message):
        clone_map(url, tmp_path / "c")
    assert not (tmp_path / "c").exists()
    push_map(tmp_path / "a", f"{url}2")
    assert clone_map(f"{url}2", tmp_path / "c").number == 4


def test_who_filled_a_gap_notices_at_the_next_exchange(tmp_path: Path) -> None:
    """A clone that has only the versions before a gap does not ask for those behind it."""
    for number in (2, 3):
        change_room(tmp_path / "a", 0, number)
    push_map(tmp_path / "a")
    (tmp_path / "bucket" / version_name(2)).unlink()
    change_room(tmp_path / "b", 1, 4)
    assert push_map(tmp_path / "b").pushed == 1
    with pytest.raises(ValueError, match="version 3 is not the one that came before"):
        pull_map(tmp_path / "b")


def test_another_map_does_not_fill_a_gap(tmp_path: Path, url: str) -> None:
    for number in (2, 3):
        change_room(tmp_path / "a", 0, number)
    push_map(tmp_path / "a")
    for number in (1, 2):
        (tmp_path / "bucket" / version_name(number)).unlink()
    write_rooms(tmp_path / "new")
    with pytest.raises(FileNotFoundError, match="version 1 is missing, but version 3 is there"):
        push_map(tmp_path / "new", url)
    assert not (tmp_path / "bucket" / version_name(1)).exists()


def test_a_bucket_that_is_gone_or_was_emptied_is_named(tmp_path: Path, url: str) -> None:
    change_room(tmp_path / "a", 0)
    shutil.rmtree(tmp_path / "bucket")
    with pytest.raises(FileNotFoundError, match="there is no such folder"):
        pull_map(tmp_path / "a")
    (tmp_path / "bucket").mkdir()
    for exchange in (pull_map, push_map):
        with pytest.raises(FileNotFoundError, match="version 1 is missing, which it had before"):
            exchange(tmp_path / "a")
    with pytest.raises(FileNotFoundError, match="there is no shared map"):
        clone_map(url, tmp_path / "c")
