"""Memory of this process."""

from __future__ import annotations

import os
from pathlib import Path

STATM = Path("/proc/self/statm")
"""Memory of this process on Linux, pages."""


def resident_mib() -> float | None:
    """Return the resident memory of this process, MiB; None where the system does not say it."""
    try:
        pages = int(STATM.read_text(encoding="ascii").split()[1])
    except OSError:
        return None
    return pages * os.sysconf("SC_PAGE_SIZE") / (1 << 20)
