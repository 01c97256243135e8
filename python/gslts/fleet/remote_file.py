"""Single files of people, beside shared maps in a bucket or a folder."""

from __future__ import annotations

from gslts.fleet.remote_store import RemoteStore
from gslts.fleet.url import is_url, require_url


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
    content = RemoteStore(folder).read_object(name, max_bytes)
    if content is None:
        raise FileNotFoundError(f"{url}: there is no such file")
    return content
