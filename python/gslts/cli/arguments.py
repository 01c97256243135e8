"""Arguments that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

MapFolder = Annotated[Path, typer.Argument(metavar="MAP", help="Folder of a map.")]
Clip = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="CLIP of the semantics of the map, if it was moved."),
]
