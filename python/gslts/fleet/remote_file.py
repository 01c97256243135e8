"""Single files of people, beside shared maps in a bucket or a folder."""

from __future__ import annotations

import obstore

from gslts.fleet.remote_store import RemoteStore
from gslts.fleet.url import is_url, require_url


class _RemoteFolder(RemoteStore):
    """Folder of a bucket."""

    def read(self, name: str, max_bytes: int) -> bytes:
        try:
            with self._named_errors():
                found = obstore.get(self._store, name)
                if found.meta["size"] > max_bytes:
                    raise ValueError(f"{self.url}/{name}: larger than {max_bytes} bytes")
                return bytes(found.bytes())
        except FileNotFoundError:
            raise FileNotFoundError(f"{self.url}/{name}: there is no such file") from None


def read_remote_file(url: str, max_bytes: int) -> bytes:
    """Read a file behind a URL.

    Args:
        url: As of a shared map.
        max_bytes: Maximum size.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is too large, or the URL is none of a file.
    """
    folder, _, name = require_url(url).rpartition("/")
    if not is_url(folder):
        raise ValueError(f"{url}: expected a file in a bucket or a folder")
    return _RemoteFolder(folder).read(name, max_bytes)
