"""Description of an installation: results of jobs are the same where it is the same."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

LIBRARIES = (
    "gslts",
    "distributed",
    "embreex",
    "numpy",
    "opencv-contrib-python-headless",
    "torch",
)
"""Distributions whose versions are named in results, where they are installed."""


def library_versions() -> dict[str, str]:
    """Return the versions of `LIBRARIES` that are installed, by name."""
    found = {}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # An optional one.
            continue
    return found


@cache
def describe_installation() -> dict[str, str]:
    """Describe the code that runs here: versions of libraries, and a digest of our own files.

    Returns:
        Values by name; `code` is the digest of all modules of gslts, Python and compiled.
    """
    root, code = Path(__file__).parents[2], hashlib.sha256()
    for path in sorted(root.glob("gslts*/**/*")):
        if path.suffix in (".py", ".so"):
            code.update(f"{path.relative_to(root)} {path.stat().st_size}\n".encode())
            code.update(path.read_bytes())
    return {**library_versions(), "code": code.hexdigest()[:12]}
