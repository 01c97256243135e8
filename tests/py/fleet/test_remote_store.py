"""Version objects and blobs in a folder."""

import hashlib
import zlib
from pathlib import Path

import pytest

from gslts.fleet.constants import MAX_COMPRESSED_BYTES
from gslts.fleet.remote_store import RemoteStore, blob_name
from gslts.store.records import Blob


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
    remote.create_version(count + 2, b"after a gap")
    assert list(remote.read_versions(1)) == contents


def blob_of(content: bytes) -> Blob:
    return Blob(key=hashlib.sha256(content).hexdigest(), size=len(content))


@pytest.mark.parametrize("size", [0, 1, 1000, MAX_COMPRESSED_BYTES, MAX_COMPRESSED_BYTES + 1])
def test_a_blob_comes_back(tmp_path: Path, remote: RemoteStore, size: int) -> None:
    content = bytes(range(256)) * (size // 256) + bytes(size % 256)
    (tmp_path / "sent").write_bytes(content)
    remote.upload([(blob_of(content), tmp_path / "sent")])
    remote.download([(blob_of(content), tmp_path / "received" / "blob")])
    assert (tmp_path / "received" / "blob").read_bytes() == content


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
    with pytest.raises(ValueError, match=r"00000001\.json: larger than 16777216 bytes"):
        remote.read_version(1)
