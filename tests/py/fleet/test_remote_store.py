"""Version objects and blobs in a folder."""

import hashlib
import zlib
from collections import Counter
from pathlib import Path

import pytest

from gslts.fleet.constants import MAX_COMPRESSED_BYTES
from gslts.fleet.remote_store import RemoteStore, blob_name, version_name
from gslts.store.records import Blob


@pytest.fixture(autouse=True)
def no_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ask again at once where a store may be late."""
    monkeypatch.setattr("gslts.fleet.remote_store.WAIT_S", 0.0)


@pytest.fixture
def remote(tmp_path: Path) -> RemoteStore:
    return RemoteStore(f"file://{tmp_path}/bucket", create=True)


def test_a_version_is_created_once(remote: RemoteStore) -> None:
    assert remote.read_version(1) is None
    assert remote.create_version(1, b"first")
    assert remote.create_version(1, b"first")  # The answer to the first request was lost.
    assert not remote.create_version(1, b"other")
    assert remote.read_version(1) == b"first"


@pytest.mark.parametrize("count", [0, 1, 2, 3, 7, 200])
def test_all_versions_are_read_in_order(remote: RemoteStore, count: int) -> None:
    contents = [f"version {number}".encode() for number in range(1, count + 1)]
    for number, content in enumerate(contents, start=1):
        remote.create_version(number, content)
    remote.check_end(count)
    assert list(remote.read_versions(1)) == contents


@pytest.mark.parametrize("removed", range(1, 20))
def test_a_version_that_was_removed_from_the_middle_is_found(
    tmp_path: Path, remote: RemoteStore, removed: int
) -> None:
    for number in range(1, 21):
        remote.create_version(number, b"version")
    (tmp_path / "bucket" / version_name(removed)).unlink()
    message = f"version {removed} is missing, but version {removed + 1} is there; restore versions"
    with pytest.raises(FileNotFoundError, match=message):
        remote.check_end(len(list(remote.read_versions(1))))


def test_a_wide_gap_is_found(remote: RemoteStore) -> None:
    for number in (1, 2, 200):
        remote.create_version(number, b"version")
    assert len(list(remote.read_versions(1))) == 2
    with pytest.raises(FileNotFoundError, match="version 3 is missing, but version 200 is there"):
        remote.check_end(2)


def test_other_objects_are_no_versions(tmp_path: Path, remote: RemoteStore) -> None:
    remote.create_version(1, b"version")
    for name in ("00000003.json.bak", "3.json", "notes.txt"):
        (tmp_path / "bucket" / "versions" / name).write_text("x")
    remote.check_end(1)


class LateStore(RemoteStore):
    """A store that does not show objects when they are asked for the first times.

    Args:
        url: Of the map.
        late: Number of such requests for each object.
    """

    def __init__(self, url: str, late: int) -> None:
        super().__init__(url)
        self._late, self._asked = late, Counter[str]()

    def read_object(self, name: str, max_bytes: int) -> bytes | None:
        self._asked[name] += 1
        return super().read_object(name, max_bytes) if self._asked[name] > self._late else None


@pytest.mark.parametrize("late", range(5))
def test_a_store_that_is_late_is_waited_for(remote: RemoteStore, late: int) -> None:
    for number in (1, 2):
        remote.create_version(number, b"version")
    shown = LateStore(remote.url, late).read_versions(1, is_known=True)
    assert next(shown) == b"version"
    assert not LateStore(remote.url, late).create_version(2, b"other")


def test_a_version_that_is_shown_after_a_later_one_is_no_gap(remote: RemoteStore) -> None:
    for number in (1, 2):
        remote.create_version(number, b"version")
    late = LateStore(remote.url, 1)
    assert late.read_version(2) is None
    assert list(late.read_versions(1)) == []  # Asks for both, and is shown the second one.
    late.check_end(0)
    assert list(late.read_versions(1)) == [b"version"] * 2


def blob_of(content: bytes) -> Blob:
    return Blob(key=hashlib.sha256(content).hexdigest(), size=len(content))


@pytest.mark.parametrize("size", [0, 1, 1000, MAX_COMPRESSED_BYTES, MAX_COMPRESSED_BYTES + 1])
def test_a_blob_comes_back(tmp_path: Path, remote: RemoteStore, size: int) -> None:
    content = bytes(range(256)) * (size // 256) + bytes(size % 256)
    (tmp_path / "sent").write_bytes(content)
    remote.upload([(blob_of(content), tmp_path / "sent")])
    remote.download([(blob_of(content), tmp_path / "received" / "blob")])
    assert (tmp_path / "received" / "blob").read_bytes() == content


def test_a_file_of_two_versions_is_written_once(
    tmp_path: Path, remote: RemoteStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sent").write_bytes(b"content")
    blob, path = blob_of(b"content"), tmp_path / "received"
    remote.upload([(blob, tmp_path / "sent")])
    written: list[int] = []
    monkeypatch.setattr("os.fsync", written.append)
    remote.download([(blob, tmp_path / "other")])
    syncs = len(written)
    remote.download([(blob, path), (blob, path)])
    assert path.read_bytes() == b"content"
    assert len(written) == 2 * syncs


@pytest.mark.parametrize(
    "stored",
    [b"", b"no zlib", zlib.compress(b"other"), zlib.compress(bytes(1 << 20)), bytes(1 << 20)],
)
def test_a_wrong_blob_is_not_written(tmp_path: Path, remote: RemoteStore, stored: bytes) -> None:
    blob = blob_of(b"right")
    path = tmp_path / "bucket" / blob_name(blob)
    path.parent.mkdir(parents=True)
    path.write_bytes(stored)
    with pytest.raises(ValueError, match="damaged: its checksum does not match its name"):
        remote.download([(blob, tmp_path / "received")])
    assert not (tmp_path / "received").exists()


def test_a_damaged_file_is_not_uploaded(tmp_path: Path, remote: RemoteStore) -> None:
    (tmp_path / "sent").write_bytes(b"wrong")
    with pytest.raises(ValueError, match="sent: damaged"):
        remote.upload([(blob_of(b"right"), tmp_path / "sent")])
    assert not (tmp_path / "bucket" / blob_name(blob_of(b"right"))).exists()


def test_a_version_that_is_too_large_is_not_read(tmp_path: Path, remote: RemoteStore) -> None:
    path = tmp_path / "bucket" / "versions" / "00000001.json"
    path.parent.mkdir()
    with path.open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(ValueError, match=r"00000001\.json: larger than 16,777,216 bytes"):
        remote.read_version(1)
