"""Objects of a shared map in a bucket of S3, Google or Azure, or in a folder."""

from __future__ import annotations

import hashlib
import re
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from gslts.fleet.constants import (
    CONNECTIONS,
    CREATE_ATTEMPTS,
    CREATE_WAIT_S,
    MAX_BLOB_BYTES,
    MAX_COMPRESSED_BYTES,
    MAX_PROBES,
    MAX_VERSION_BYTES,
    RETRIES,
)
from gslts.fleet.url import require_url
from gslts.io.atomic_files import write_atomic
from gslts.store.records import Blob

try:
    import obstore
    from obstore.exceptions import (
        AlreadyExistsError,
        BaseError,
        PermissionDeniedError,
        UnauthenticatedError,
    )
    from obstore.store import LocalStore, from_url
except ImportError as error:
    raise ImportError("shared maps need obstore: pip install 'gslts[fleet]'") from error

CREDENTIALS = {
    "s3": "AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY",
    "gs": "GOOGLE_APPLICATION_CREDENTIALS",
    "az": "AZURE_STORAGE_ACCOUNT_NAME and AZURE_STORAGE_ACCOUNT_KEY",
}
"""Environment variables of credentials, by scheme."""
NO_CREDENTIALS = re.compile("169\\.254\\.169\\.254|Account must be specified|MissingAccount")
"""Errors of obstore without credentials: it asks the host of a virtual machine for some."""
MAX_OVERHEAD_BYTES = 4096
"""Maximum number of bytes by which compression may enlarge a blob; zlib's worst case is smaller."""
MAX_MESSAGE = 200
"""Maximum length of a reason of a store in an error, characters."""


class RemoteStore:
    """Version objects and blobs of one shared map. Listings are not used: they may be late.

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
        with self._named_errors():
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
            with self._named_errors():
                found = obstore.get(self._store, name)
                if found.meta["size"] > max_bytes:
                    raise ValueError(f"{self.url}/{name}: larger than {max_bytes} bytes")
                return bytes(found.bytes())
        except FileNotFoundError:
            return None

    def read_versions(self, first: int) -> Iterator[bytes]:
        """Read version objects until one is missing.

        Args:
            first: Number of the first version to read.

        Yields:
            Their contents.

        Raises:
            OSError: The store cannot be read.
            ValueError: An object is too large.
        """
        count = 2
        while True:
            numbers = range(first, first + count)
            with ThreadPoolExecutor(CONNECTIONS) as pool:
                contents = list(pool.map(self.read_version, numbers))
            for content in contents:
                if content is None:
                    return
                yield content
            first, count = first + count, min(2 * count, MAX_PROBES)

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
        name, wait_s = version_name(number), CREATE_WAIT_S
        failure: OSError | None = None
        for _ in range(CREATE_ATTEMPTS):
            try:
                with self._named_errors():
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
            time.sleep(wait_s)
            wait_s *= 2
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
        with ThreadPoolExecutor(CONNECTIONS) as pool:
            futures = [pool.submit(work, blob, path) for blob, path in files]
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
            with self._named_errors():
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
            raise ValueError(f"{self.url}/{name}: larger than {MAX_BLOB_BYTES} bytes")
        try:
            with self._named_errors():
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

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        """Raise errors of obstore as OSError in one line with the URL."""
        try:
            yield
        except AlreadyExistsError as error:
            raise FileExistsError(f"{self.url}: {_reason(error)}") from error
        except (PermissionDeniedError, UnauthenticatedError) as error:
            raise PermissionError(
                f"{self.url}: not permitted; check the credentials, and the clock of this machine"
            ) from error
        except BaseError as error:
            if NO_CREDENTIALS.search(str(error)):
                variables = CREDENTIALS[urlsplit(self.url).scheme]
                raise PermissionError(
                    f"{self.url}: there are no credentials: set {variables}"
                ) from error
            raise OSError(f"{self.url}: {_reason(error)}") from error


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


def _reason(error: BaseException) -> str:
    """Return the reason of an error of obstore: its first line without times and XML."""
    text = re.sub(r" in [\d.]+.?s\b.*? - ", ": ", str(error).split("\n", 1)[0]).split("<?xml")[0]
    if "error sending request" in text:
        return "the store cannot be reached; check the network, the endpoint and the URL"
    return text.strip(" :")[:MAX_MESSAGE]
