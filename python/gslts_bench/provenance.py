"""Facts that results depend on besides the code: command, commit, date, machine and versions."""

from __future__ import annotations

import os
import platform
import shlex
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gslts.fleet.installation import library_versions


def describe_run() -> dict[str, Any]:
    """Describe the running command for its result.

    Returns:
        JSON values: `command`, `commit`, `changed_since`, `date`, `machine` and `versions`.
    """
    from gslts._core import simd

    return {
        "command": shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]]),
        **describe_commit(Path(__file__).parent),
        "machine": {**describe_machine(), "instruction_set": simd.target()},
        "versions": library_versions(),
    }


def describe_machine() -> dict[str, Any]:
    """Describe processor, cores, caches, memory, system and load.

    Returns:
        JSON values.
    """
    return {
        "cpu": cpu_model(),
        "cores": os.cpu_count(),
        "caches": cpu_caches(),
        "memory_bytes": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        "system": platform.platform(),
        "python": platform.python_version(),
        "load_average_1min": os.getloadavg()[0],
    }


def cpu_model() -> str:
    """Return the processor's name as the system gives it."""
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def cpu_caches() -> dict[str, str]:
    """Return the caches of the first core, such as {"L2": "1024K"}; empty if none is named."""
    caches = {}
    for folder in sorted(Path("/sys/devices/system/cpu/cpu0/cache").glob("index*")):
        kind = (folder / "type").read_text().strip()
        suffix = {"Data": "d", "Instruction": "i"}.get(kind, "")
        level = (folder / "level").read_text().strip()
        caches[f"L{level}{suffix}"] = (folder / "size").read_text().strip()
    return caches


def describe_commit(repository: Path) -> dict[str, Any]:
    """Describe the state of a repository now.

    Args:
        repository: A folder in it.

    Returns:
        `commit` (None outside a repository), `changed_since` (whether files differ from it) and
        `date` in UTC.
    """
    changes = _git(repository, "status", "--porcelain")
    return {
        "commit": _git(repository, "rev-parse", "HEAD"),
        "changed_since": None if changes is None else bool(changes),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _git(repository: Path, *arguments: str) -> str | None:
    """Return the output of a git command, None where there is no repository or no commit."""
    try:
        result = subprocess.run(
            ["git", "-C", str(repository), *arguments], check=True, capture_output=True, text=True
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return result.stdout.strip()
