"""How far a robot has come with its rounds, in a file beside the map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gslts.io.atomic_files import write_atomic
from gslts.keeper.schedule import DeferredChange

STATE = "loop.json"
MAX_BYTES = 1 << 26


class LoopState(BaseModel):
    """Where the robot is, which is all that a run that was killed needs to go on.

    What it had seen but not repaired is seen again, where it can look once more: of a recording,
    each frame is looked at once a round.

    Attributes:
        round: Number of the round, from 0 on.
        source: Whose rounds these are, such as those of one recording; "" where nobody tells.
        of_source: How many rounds of it are done.
        left: Names of the viewpoints that it has still to go to in this round; None before its
            start.
        deferred: Changes that could not be repaired.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    schema_version: Literal[1] = 1
    round: Annotated[int, Field(ge=0)] = 0
    source: str = ""
    of_source: Annotated[int, Field(ge=0)] = 0
    left: tuple[str, ...] | None = None
    deferred: tuple[DeferredChange, ...] = ()


def read_state(folder: Path) -> LoopState:
    """The state in the folder of a map; that of a beginning if there is none.

    Raises:
        OSError: It cannot be read.
        ValueError: It is damaged.
    """
    path = folder / STATE
    if not path.exists():
        return LoopState()
    with path.open("rb") as file:
        content = file.read(MAX_BYTES)
    try:
        return LoopState.model_validate_json(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "file"
        raise ValueError(
            f"{path}: {where}: {first['msg']}; without this file, rounds begin anew"
        ) from None


def write_state(state: LoopState, folder: Path) -> None:
    """Writes it, all or nothing.

    Raises:
        OSError: It cannot be written.
    """
    write_atomic(folder / STATE, (state.model_dump_json(indent=1) + "\n").encode())
