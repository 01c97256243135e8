"""Objects of a shared map in a bucket of S3, Google or Azure, or in a folder."""

from __future__ import annotations

import hashlib
import re
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from gslts.fleet.constants import (
    ATTEMPTS,
    CONNECTIONS,
    MAX_BLOB_BYTES,
    MAX_COMPRESSED_BYTES,
    MAX_PROBES,
    MAX_VERSION_BYTES,
    RETRIES,
    WAIT_S,
)
from gslts.fleet.store_errors import named_errors, require_endpoint
from gslts.fleet.url import require_url
from gslts.io.atomic_files import write_atomic
from gslts.store.records import Blob

try:
    import obstore
    from obstore.store import LocalStore, from_url
except ImportError as error:
    raise ImportError("shared maps need obstore: pip install 'gslts[fleet]'") from error


VERSION_NAME = re.compile("versions/(\\d{8})\\.json")
"""Names of version objects."""
MAX_OVERHEAD_BYTES = 4096
"""Maximum number of bytes by which compression may enlarge a blob; zlib's worst case is smaller."""


class RemoteStore:
    """Version objects and blobs of one shared map. Listings may be late: none is relied on.

    Args:
        url: Of the map: s3://, gs://, az:// or file://. Credentials come from the environment.
        create: Make the folder of a file:// URL. Buckets are never made.

    Raises:
        OSError: The store cannot be opened.
        ValueError: The URL is none of these.
    """

    def __init__(self, url: str, *, create: bool = False) -> None:
        self.url = require_url(url)
        parts = urlsplit(self.url)
        require_endpoint(self.url)
        with named_errors(self.url, "reading"):
            if parts.scheme == "file":
                folder = Path(unquote(parts.path))
                if not create and not folder.is_dir():
                    raise FileNotFoundError(f"{url}: there is no such folder")
                self._store: Any = LocalStore(folder, mkdir=create)
            else:
                self._store = from_url(self.url, retry_config=RETRIES)

    def read_version(self, number: int) -> bytes | None:
        """Read a version object.

        Args:
            number: Of the version.

        Returns:
            Its content; None if there is no such version.

        Raises:
            OSError: The store cannot be read.
            ValueError: The object is too large.
        """
        return self.read_object(version_name(number), MAX_VERSION_BYTES)

    def read_object(self, name: str, max_bytes: int) -> bytes | None:
        """Read a small object.

        Args:
            name: Below the URL.
            max_bytes: Maximum size.

        Returns:
            Its content; None if there is no such object.

        Raises:
            OSError: The store cannot be read.
            ValueError: The object is too large.
        """
        try:
            with named_errors(self.url, "reading"):
                found = obstore.get(self._store, name)
                if found.meta["size"] > max_bytes:
                    raise ValueError(f"{self.url}/{name}: larger than {max_bytes:,} bytes")
                return bytes(found.bytes())
        except FileNotFoundError:
            return None

    def read_versions(self, first: int, *, is_known: bool = False) -> Iterator[bytes]:
        """Read version objects until one is missing.

        Args:
            first: Number of the first version to read.
            is_known: The first version was there before: a store that is late is waited for.

        Yields:
            Their contents.

        Raises:
            OSError: The store cannot be read, or a later version is there.
            ValueError: An object is too large.
        """
        count = 2
        while True:
            numbers = range(first, first + count)
            contents = self._read_batch(numbers)
            if is_known and contents[first] is None and self._appears(first):
                contents = self._read_batch(numbers)
            is_known = False
            for number, content in contents.items():
                if content is None:
                    self._check_gap(number, [n for n in numbers if contents[n] is not None])
                    return
                yield content
            first, count = first + count, min(2 * count, MAX_PROBES)

    def check_end(self, number: int) -> None:
        """Check by a listing that no later versions follow a missing one.

        A listing that is late, or that the credentials do not permit, finds nothing.

        Args:
            number: Of the last version before the first missing one.

        Raises:
            OSError: The store cannot be read, or a later version is there.
        """
        try:
            with named_errors(self.url, "listing"):
                found = obstore.list(
                    self._store, prefix="versions/", offset=version_name(number + 1)
                )
                names = [VERSION_NAME.fullmatch(item["path"]) for item in next(iter(found), ())]
        except (PermissionError, FileNotFoundError):
            return
        self._check_gap(number + 1, [int(name[1]) for name in names if name])

    def _read_batch(self, numbers: Sequence[int]) -> dict[int, bytes | None]:
        with ThreadPoolExecutor(CONNECTIONS) as pool:
            return dict(zip(numbers, pool.map(self.read_version, numbers), strict=True))

    def _appears(self, number: int) -> bool:
        """Return whether a version is there, or comes soon: stores may show new objects late."""
        return any(self.read_version(number) is not None for _ in _attempts())

    def _check_gap(self, missing: int, present: Sequence[int]) -> None:
        """Raise an error if a version is missing although a later one is there."""
        later = min((number for number in present if number > missing), default=None)
        if later is None or self.read_version(later) is None or self._appears(missing):
            return
        raise FileNotFoundError(
            f"{self.url}: version {missing} is missing, but version {later} is there; restore "
            f"{version_name(missing)} from a backup of the bucket, or push a clone that has "
            f"version {later} to a new URL"
        )

    def create_version(self, number: int, content: bytes) -> bool:
        """Create a version object, unless there is one of this number.

        Args:
            number: Of the version.
            content: Of the object.

        Returns:
            True if the object is there with this content; False if it has another one.

        Raises:
            OSError: The store cannot be written, or does not tell if the object is there.
        """
        name = version_name(number)
        failure: OSError | None = None
        for _ in _attempts():
            try:
                with named_errors(self.url, "writing"):
                    obstore.put(self._store, name, content, mode="create", use_multipart=False)
                return True
            except FileExistsError as error:
                failure = error
            except PermissionError:
                raise
            except FileNotFoundError as error:
                raise FileNotFoundError(
                    f"{self.url}: there is no such bucket; create it, or check the URL"
                ) from error
            except OSError as error:
                failure = error  # The object may be there although the answer was lost.
            there = self.read_version(number)
            if there is not None:
                return there == content
        raise OSError(f"{failure}; nothing of version {number} is lost here: push again")

    def upload(self, files: Sequence[tuple[Blob, Path]]) -> None:
        """Upload blobs.

        Args:
            files: Blobs and the files that hold them.

        Raises:
            OSError: A file cannot be read, or the store not be written.
        """
        self._for_each(self._upload, files)

    def download(self, files: Sequence[tuple[Blob, Path]]) -> None:
        """Download blobs, check them, and write them atomically. Files that are there stay.

        Args:
            files: Blobs and the files to write.

        Raises:
            OSError: A blob is missing or a file cannot be written.
            ValueError: A blob is damaged or too large.
        """
        self._for_each(self._download, files)

    def _for_each(
        self, work: Callable[[Blob, Path], None], files: Sequence[tuple[Blob, Path]]
    ) -> None:
        blobs = {path: blob for blob, path in files}  # Versions may share a file.
        with ThreadPoolExecutor(CONNECTIONS) as pool:
            futures = [pool.submit(work, blob, path) for path, blob in blobs.items()]
            try:
                for future in futures:
                    future.result()
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise

    def _upload(self, blob: Blob, path: Path) -> None:
        content = path.read_bytes()
        if not _is(content, blob):
            raise ValueError(f"{path}: damaged: its checksum is not that of its version")
        try:
            with named_errors(self.url, "writing"):
                obstore.put(self._store, blob_name(blob), _compress(content))
        except FileNotFoundError as error:
            raise FileNotFoundError(
                f"{self.url}: there is no such bucket; create it, or check the URL"
            ) from error

    def _download(self, blob: Blob, path: Path) -> None:
        if path.exists() and path.stat().st_size == blob.size and _is(path.read_bytes(), blob):
            return
        name = blob_name(blob)
        if blob.size > MAX_BLOB_BYTES:
            raise ValueError(f"{self.url}/{name}: larger than {MAX_BLOB_BYTES:,} bytes")
        try:
            with named_errors(self.url, "reading"):
                found = obstore.get(self._store, name)
                is_small = found.meta["size"] <= blob.size + MAX_OVERHEAD_BYTES
                content = _decompress(bytes(found.bytes()), blob.size) if is_small else b""
        except FileNotFoundError:
            raise FileNotFoundError(f"{self.url}/{name}: missing; push it again") from None
        if not _is(content, blob):
            raise ValueError(
                f"{self.url}/{name}: damaged: its checksum does not match its name; remove it and "
                "push again from an intact clone"
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, content)


def _attempts() -> Iterator[int]:
    """Yield the numbers of some attempts, with a wait between them that doubles each time."""
    yield 0
    for attempt in range(1, ATTEMPTS):
        time.sleep(WAIT_S * 2 ** (attempt - 1))
        yield attempt


def version_name(number: int) -> str:
    """Return the name of a version object.

    Args:
        number: Of the version.
    """
    return f"versions/{number:08}.json"


def blob_name(blob: Blob) -> str:
    """Return the name of a blob.

    Args:
        blob: With a key of hexadecimal digits.
    """
    return f"blobs/{blob.key[:2]}/{blob.key}"


def _compress(content: bytes) -> bytes:
    return content if len(content) > MAX_COMPRESSED_BYTES else zlib.compress(content)


def _decompress(content: bytes, size: int) -> bytes:
    """Return the content of a blob of a size; damaged content gives another one."""
    if size > MAX_COMPRESSED_BYTES:
        return content
    try:
        return zlib.decompressobj().decompress(content, size + 1)  # Bounds the memory.
    except zlib.error:
        return b""


def _is(content: bytes, blob: Blob) -> bool:
    return len(content) == blob.size and hashlib.sha256(content).hexdigest() == blob.key
