"""How much memory there is."""

from __future__ import annotations

import re
from pathlib import Path

MEMINFO = Path("/proc/meminfo")


def free_memory_bytes() -> int | None:
    """What programs may still take without swapping; None where the system does not tell."""
    try:
        free_kib = re.search(r"^MemAvailable: *(\d+) kB$", MEMINFO.read_text(), re.MULTILINE)
    except OSError:
        return None
    return None if free_kib is None else 1024 * int(free_kib[1])
