"""Clones of shared maps in the cache of this user, for commands that are given a URL."""

from __future__ import annotations

import hashlib
import logging
import os
import re
from pathlib import Path

from gslts.fleet.exchange import clone_map, pull_map
from gslts.fleet.url import require_url

_logger = logging.getLogger(__name__)


def cached_clone(url: str) -> Path:
    """Return a clone of a shared map with its newest version.

    Args:
        url: Of the shared map.

    Returns:
        Folder of the map, the same one for each call with this URL. Versions that could not be
        pushed stay in it.

    Raises:
        OSError: The map cannot be read, or the folder not be written.
        ValueError: The map is damaged or of a newer format.
    """
    folder = _cache_folder(require_url(url))
    if not folder.exists():
        try:
            clone_map(url, folder)
            return folder
        except OSError:
            if not folder.exists():  # Else another command was faster.
                raise
    try:
        pull_map(folder)
    except BlockingIOError:
        _logger.warning("%s: another command writes %s, so that nothing was pulled", url, folder)
    return folder


def _cache_folder(url: str) -> Path:
    caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    name = re.sub(r"[^\w.-]", "-", url.rsplit("/", 1)[-1])
    return caches / "gslts" / "maps" / f"{name}-{hashlib.sha256(url.encode()).hexdigest()[:12]}"
