"""State of a clone: `remote.json` in the folder of the map."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import ValidationError

from gslts.io.atomic_files import write_atomic
from gslts.io.bounded_files import read_bounded
from gslts.io.messages import first_problem
from gslts.store.causes import Count, Record, Sha256

STATE = "remote.json"
"""File name in the folder of the map."""
MAX_BYTES = 1 << 16
"""Bounds the memory for a hostile file."""


class RemoteState(Record):
    """Shared map of a clone, and the versions that both are known to have.

    Attributes:
        schema_version: Layout of the file.
        url: Of the shared map.
        number: Newest version that both are known to have; 0 before the first exchange.
        digest: SHA-256 of its version object; None before the first exchange.
    """

    schema_version: Literal[1] = 1
    url: str
    number: Count = 0
    digest: Sha256 | None = None


def read_remote_state(folder: Path) -> RemoteState | None:
    """Read the state of a clone.

    Args:
        folder: Folder of the map.

    Returns:
        The state; None if the map was never shared.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged.
    """
    path = folder / STATE
    if not path.exists():
        return None
    content = read_bounded(path, MAX_BYTES)
    try:
        return RemoteState.model_validate_json(content)
    except ValidationError as error:
        raise ValueError(
            f"{path}: {first_problem(error)}; remove the file and push or pull with a URL"
        ) from None


def require_remote_state(folder: Path) -> RemoteState:
    """Read the state of a map that must have been shared; see `read_remote_state`.

    Args:
        folder: Folder of the map.

    Raises:
        OSError: The file cannot be read.
        ValueError: The map was never shared, or the file is damaged.
    """
    state = read_remote_state(folder)
    if state is None:
        raise ValueError(f"{folder}: it was never shared: gslts push {folder} URL shares it")
    return state


def write_remote_state(state: RemoteState, folder: Path) -> None:
    """Write the state of a clone, atomically.

    Args:
        state: To write.
        folder: Folder of the map.

    Raises:
        OSError: The file cannot be written.
    """
    write_atomic(folder / STATE, (state.model_dump_json(indent=1) + "\n").encode())
