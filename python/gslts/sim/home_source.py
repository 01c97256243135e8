"""Where a home comes from, told so that another machine finds the same one."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from gslts.sim.gltf.load import load_home
from gslts.sim.home import Home
from gslts.sim.procedural.homes import make_home

STRICT = ConfigDict(frozen=True, extra="forbid", strict=True)

COARSE = 0.05
"""Detail of textures where only shapes matter."""


class HomeSource(BaseModel):
    """How to rebuild a home: a room type and a seed.

    `sha256` is that of the shapes and places of what they make, so that another version of the
    generator cannot pass for the one that the task was made with.
    """

    model_config = STRICT

    room_type: str
    seed: Annotated[int, Field(ge=0)]
    sha256: str

    @classmethod
    def of_seed(cls, room_type: str, seed: int) -> tuple[HomeSource, Home]:
        """The source and the home, whose textures are coarse."""
        home = make_home(room_type, seed, detail=COARSE)
        return cls(room_type=room_type, seed=seed, sha256=shape_digest(home)), home

    def load(self, _folder: Path) -> Home:
        """The home.

        Raises:
            ValueError: It cannot be made, or it is another one.
        """
        home = make_home(self.room_type, self.seed)
        if shape_digest(home) != self.sha256:
            raise ValueError(
                f"{home.name} is not the home of this task: another version of gslts made it"
            )
        return home


class FileSource(BaseModel):
    """How to find a home that is kept in a glTF file; relative to the folder of the script."""

    model_config = STRICT

    file: str
    sha256: str

    def load(self, folder: Path) -> Home:
        """The home.

        Raises:
            OSError: The file cannot be read.
            ValueError: It is another file, or no home.
        """
        path = folder / self.file
        digest = file_digest(path)
        if digest != self.sha256:
            raise ValueError(f"{path} is not the file of this task: its SHA-256 is {digest}")
        return load_home(path)

    @classmethod
    def of_path(cls, path: Path, folder: Path) -> tuple[FileSource, Home]:
        """The source for a script in a folder, and the home.

        Raises:
            OSError: The file cannot be read.
            ValueError: It is no home.
        """
        relative = os.path.relpath(path.resolve(), folder.resolve())
        return cls(file=Path(relative).as_posix(), sha256=file_digest(path)), load_home(path)


def shape_digest(home: Home) -> str:
    """SHA-256 of the objects of a home, their shapes and places, in hexadecimal digits.

    Textures are left out: they come from sums whose last bits may differ between machines.
    """
    result = hashlib.sha256(home.name.encode())
    for thing in home.objects:
        result.update(repr((thing.id, thing.type, thing.movable, thing.parent)).encode())
        for array in (thing.boxes, thing.world_from_object):
            result.update(array.tobytes())
        for surface in thing.surfaces:
            result.update(surface.vertices.tobytes())
            result.update(surface.faces.tobytes())
    return result.hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits.

    Raises:
        OSError: It cannot be read.
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
