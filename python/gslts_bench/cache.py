"""Cached folders of recordings, maps and cases, whose names hold a digest of what made them."""

from __future__ import annotations

import ast
import fcntl
import hashlib
import importlib.util
import json
import shutil
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from gslts.io.atomic_files import write_atomic

ROOT = Path(__file__).parent.parent
"""Folder that holds the packages gslts, gslts_sim and gslts_bench."""
OUR_PACKAGES = ("gslts", "gslts_bench", "gslts_sim")
"""Packages whose modules make up the digest of the code."""
MADE_OF = "made_of.json"
"""File in each folder with the values whose digest is in the folder's name."""


def digest(made_of: Any) -> str:
    """Compute a digest of JSON values that does not depend on the order of keys.

    Args:
        made_of: JSON values; no NaN.

    Returns:
        The first 16 hexadecimal digits of the SHA-256.
    """
    text = json.dumps(made_of, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@cache
def code_digest(*names: str, without: tuple[str, ...] = ()) -> str:
    """Compute a digest of the sources of some modules and of all our modules that they import.

    Args:
        names: Modules or packages, such as "gslts_bench.homes" and "gslts_sim".
        without: Modules and packages that are not followed.

    Returns:
        16 hexadecimal digits.

    Raises:
        ValueError: A module does not exist.
    """
    paths = source_files(*names, without=without)
    return digest({path.relative_to(ROOT).as_posix(): _sha256(path) for path in paths})


def source_files(*names: str, without: tuple[str, ...] = ()) -> list[Path]:
    """List the sources of some modules and of all our modules that they import.

    Imports inside functions count as well. The facade `gslts/__init__.py` is not followed.

    Args:
        names: Modules or packages; a package stands for all modules below it.
        without: Modules and packages that are not followed.

    Returns:
        The files, sorted.

    Raises:
        ValueError: A module does not exist.
    """
    # These only distribute and keep work: their changes keep cached results valid.
    distributing = ("gslts.fleet", "gslts_bench.cache", "gslts_bench.runner")
    skipped = (*without, *distributing)
    left: list[Path] = []
    for name in names:
        file, folder = _file_of(name), ROOT.joinpath(*name.split("."))
        modules = [*([] if file is None else [file]), *sorted(folder.rglob("*.py"))]
        if not modules:
            raise ValueError(f"code_digest: there is no module {name!r}")
        left += modules
    found: set[Path] = set()
    while left:
        path = left.pop()
        if path not in found:
            found.add(path)
            imported = set(_imports_of(path))
            left += [
                file
                for name in imported
                if not any(name == skip or name.startswith(f"{skip}.") for skip in skipped)
                and (file := _file_of(name)) is not None
            ]
    return sorted(found)


@cache
def native_digest() -> str:
    """Compute a digest of the compiled module.

    Returns:
        16 hexadecimal digits.
    """
    spec = importlib.util.find_spec("gslts._core")
    assert spec is not None  # Without it, gslts cannot be imported.
    assert spec.origin is not None
    return _sha256(Path(spec.origin))[:16]


def cached_folder(folder: Path, made_of: Any, make: Callable[[Path], None]) -> Path:
    """Return a folder whose name ends in the digest of what made it; make it if it is missing.

    The folder appears whole or not at all, and no two processes make the same one.

    Args:
        folder: Path without the digest.
        made_of: JSON values that decide the content.
        make: Makes the folder at the path that it is given.

    Returns:
        Path of the folder.

    Raises:
        OSError: The folder cannot be written.
    """
    whole = folder.with_name(f"{folder.name}_{digest(made_of)}")
    if whole.is_dir():
        return whole
    whole.parent.mkdir(parents=True, exist_ok=True)
    part = whole.with_name(f".{whole.name}.part")
    with part.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # Released when the process ends, however it does.
        if whole.is_dir():
            return whole
        if part.exists():  # Left by a process that was stopped.
            shutil.rmtree(part)
        make(part)
        write_atomic(part / MADE_OF, (json.dumps(made_of, indent=1) + "\n").encode())
        part.rename(whole)
    return whole


def _file_of(name: str) -> Path | None:
    """Return the file of a module or of a package's `__init__`, None if it is not a source file."""
    if name in OUR_PACKAGES:
        return None
    stem = ROOT.joinpath(*name.split("."))
    for path in (stem.with_suffix(".py"), stem / "__init__.py"):
        if path.is_file():
            return path
    return None


def _imports_of(path: Path) -> Iterator[str]:
    """Yield our modules that a file may import, with the packages that hold them."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            # What is imported from a package may be a module of it.
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            parts = name.split(".")
            if parts[0] in OUR_PACKAGES:
                yield from (".".join(parts[:end]) for end in range(2, len(parts) + 1))


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
