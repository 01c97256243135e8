"""Folders of what was made before, found again by everything that made them."""

from __future__ import annotations

import fcntl
import hashlib
import importlib.util
import json
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from gslts.io.atomic_files import write_whole

ROOT = Path(__file__).parent.parent
"""Folder that holds the packages gslts, gslts_sim and gslts_bench."""
MADE_OF = "made_of.json"
"""In each folder: what its name is the digest of."""


def digest(made_of: Any) -> str:
    """16 hexadecimal digits of the SHA-256 of values of JSON; the order of keys does not count."""
    text = json.dumps(made_of, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@cache
def code_of(*names: str) -> str:
    """Return a digest of Python sources.

    Args:
        names: Modules and packages, such as "gslts.core" and "gslts_bench.homes".

    Raises:
        ValueError: There is no such module.
    """
    contents = {}
    for name in names:
        stem = ROOT.joinpath(*name.split("."))
        file = stem.with_suffix(".py")
        paths = [file] if file.is_file() else sorted(stem.rglob("*.py"))
        if not paths:
            raise ValueError(f"code_of: there is no module {name!r}")
        for path in paths:
            contents[path.relative_to(ROOT).as_posix()] = _sha256(path)
    return digest(contents)


@cache
def native_code() -> str:
    """A digest of the compiled module."""
    spec = importlib.util.find_spec("gslts._core")
    assert spec is not None  # Without it, gslts cannot be imported.
    assert spec.origin is not None
    return _sha256(Path(spec.origin))[:16]


def made(folder: Path, made_of: Any, make: Callable[[Path], None]) -> Path:
    """A folder whose name ends in the digest of what made it; made unless it is there.

    It appears whole or not at all, and no two processes make the same one.

    Args:
        folder: The beginning of its path.
        made_of: All that decides what is in it, in values of JSON.
        make: Is given a folder to make, beside the later one.

    Returns:
        The path of the folder.

    Raises:
        OSError: It cannot be written.
    """
    whole = folder.with_name(f"{folder.name}_{digest(made_of)}")
    if whole.is_dir():
        return whole
    whole.parent.mkdir(parents=True, exist_ok=True)
    part = whole.with_name(f".{whole.name}.part")
    with part.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # Given up when the process ends, however it does.
        if whole.is_dir():
            return whole
        if part.exists():  # Of a process that was stopped.
            shutil.rmtree(part)
        make(part)
        write_whole(part / MADE_OF, (json.dumps(made_of, indent=1) + "\n").encode())
        part.rename(whole)
    return whole


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
