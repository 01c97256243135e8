"""Limits and settings of shared maps."""

from __future__ import annotations

from datetime import timedelta
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from obstore.store import RetryConfig

MAX_VERSION_BYTES = 16 << 20
"""Maximum size of a version object: bounds the memory for a hostile one. An update with 12 frames
takes 10 kB."""
MAX_BLOB_BYTES = 8 << 30
"""Maximum size of a blob: bounds the memory for a hostile one. 80 million Gaussians take less."""
MAX_COMPRESSED_BYTES = 4 << 20
"""Size up to which blobs are compressed in the store, a part of its format: updates lose a fifth.
Snapshots of rooms are larger: their compression would take seconds, and save a tenth."""
MAX_PROBES = 64
"""Maximum number of version objects that are asked for at once. Half as many make a clone of a long
history over a slow network slower; more would ask for more objects that do not exist."""
CONNECTIONS = 16
"""Maximum number of simultaneous requests."""
RETRIES: RetryConfig = {
    "max_retries": 8,
    "retry_timeout": timedelta(seconds=60),
    "backoff": {
        "init_backoff": timedelta(milliseconds=100),
        "max_backoff": timedelta(seconds=5),
        "base": 2,
    },
}
"""Repetition of requests that failed for a reason that may pass, within obstore."""
ATTEMPTS, WAIT_S = 6, 0.2
"""Maximum number of attempts to learn if a version object is there, when answers are lost or a
store shows new objects late, and the wait after the first one, s; it doubles each time: 6 s."""
MAX_RACES = 100
"""Maximum number of times that other robots may be faster in a row before a push gives up. Somebody
makes progress each time."""
