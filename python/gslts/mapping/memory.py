"""Free memory of the machine."""

from __future__ import annotations

import re
from pathlib import Path


def free_memory_bytes() -> int | None:
    """Return the memory that can be allocated without swapping, bytes; None if unknown."""
    try:
        free_kib = re.search(
            r"^MemAvailable: *(\d+) kB$", Path("/proc/meminfo").read_text(), re.MULTILINE
        )
    except OSError:
        return None
    return None if free_kib is None else 1024 * int(free_kib[1])
