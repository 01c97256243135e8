"""Progress of the rounds of a robot, in a file in the folder of the map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gslts.io.atomic_files import write_atomic
from gslts.io.bounded_files import read_bounded
from gslts.io.messages import first_problem
from gslts.keeper.schedule import DeferredChange

STATE = "keeper.json"
"""File name in the folder of the map."""
MAX_BYTES = 1 << 26
"""Bounds the memory for a hostile file."""


class KeeperState(BaseModel):
    """Progress of the rounds: all that a killed run needs to continue.

    A change that was detected but not integrated is detected again, where the robot can observe it
    again: of a recording, each frame is processed once per round.

    Attributes:
        schema_version: Layout of the file.
        round: Number of the round, counted from 0.
        source: Name of the source of frames; "" if unknown.
        source_rounds: Number of complete rounds of this source.
        remaining: Viewpoints that are left in this round; None before it starts.
        deferred: Changes that could not be integrated.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    schema_version: Literal[1] = 1
    round: Annotated[int, Field(ge=0)] = 0
    source: str = ""
    source_rounds: Annotated[int, Field(ge=0)] = 0
    remaining: tuple[str, ...] | None = None
    deferred: tuple[DeferredChange, ...] = ()


def read_state(folder: Path) -> KeeperState:
    """Read the state from the folder of a map.

    Args:
        folder: Folder of the map.

    Returns:
        The state; the initial one if there is no file.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged.
    """
    path = folder / STATE
    if not path.exists():
        return KeeperState()
    content = read_bounded(path, MAX_BYTES)
    try:
        return KeeperState.model_validate_json(content)
    except ValidationError as error:
        raise ValueError(
            f"{path}: {first_problem(error)}; remove the file to start the rounds anew"
        ) from None


def write_state(state: KeeperState, folder: Path) -> None:
    """Write the state to the folder of a map, atomically.

    Args:
        state: To write.
        folder: Folder of the map.

    Raises:
        OSError: The file cannot be written.
    """
    write_atomic(folder / STATE, (state.model_dump_json(indent=1) + "\n").encode())
