"""What the numbers depend on besides the code: machine, commit and date."""

from __future__ import annotations

import os
import platform
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any


def cpu_model() -> str:
    """The processor's name as the system gives it."""
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def cpu_caches() -> dict[str, str]:
    """Caches of the first core, such as {"L2": "1024K"}; empty where the system names none."""
    caches = {}
    for folder in sorted(Path("/sys/devices/system/cpu/cpu0/cache").glob("index*")):
        kind = (folder / "type").read_text().strip()
        suffix = {"Data": "d", "Instruction": "i"}.get(kind, "")
        level = (folder / "level").read_text().strip()
        caches[f"L{level}{suffix}"] = (folder / "size").read_text().strip()
    return caches


def describe_machine() -> dict[str, Any]:
    """Processor, cores, caches, memory, system, and how busy the machine was."""
    return {
        "cpu": cpu_model(),
        "cores": os.cpu_count(),
        "caches": cpu_caches(),
        "memory_bytes": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        "system": platform.platform(),
        "python": platform.python_version(),
        "load_average_1min": os.getloadavg()[0],
    }


def git(repository: Path, *arguments: str) -> str | None:
    """Output of a git command, or None where there is no repository or no commit."""
    try:
        result = subprocess.run(
            ["git", "-C", str(repository), *arguments], check=True, capture_output=True, text=True
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return result.stdout.strip()


def describe_commit(repository: Path) -> dict[str, Any]:
    """The commit, and whether files differ from it."""
    changes = git(repository, "status", "--porcelain")
    return {
        "commit": git(repository, "rev-parse", "HEAD"),
        "changed_since": None if changes is None else bool(changes),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }
