"""URLs of shared maps. Imports nothing heavy."""

from __future__ import annotations

import re

URL = re.compile("(s3|gs|az|file)://.+")
"""URLs that obstore opens: Amazon S3, Google Cloud Storage, Azure Blob Storage, a folder."""


def is_url(text: str) -> bool:
    """Return whether a text is the URL of a shared map, and not a path.

    Args:
        text: Of a command line.
    """
    return URL.fullmatch(text) is not None


def require_url(text: str) -> str:
    """Check the URL of a shared map.

    Args:
        text: To check.

    Returns:
        The URL without a slash at the end.

    Raises:
        ValueError: It is none.
    """
    url = text.rstrip("/")
    if not is_url(url):
        raise ValueError(f"{text}: not a URL; expected s3://, gs://, az:// or file://")
    if url.startswith("file://") and not url.startswith("file:///"):
        raise ValueError(f"{text}: a file URL has a whole path, such as file:///mnt/maps/flat")
    return url
