"""Where a home comes from, told so that another machine finds the same one."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Annotated

from pydantic import Field

from gslts_sim.gltf.file import FILE_BYTES
from gslts_sim.gltf.load import load_home
from gslts_sim.home import Home
from gslts_sim.procedural.homes import ROOM_TYPES, make_home
from gslts_sim.strict_model import StrictModel

FILE_TYPES = (".glb", ".gltf")
"""Endings of the files that homes are kept in."""

COARSE = 0.05
"""Detail of textures where only shapes matter."""


class HomeSource(StrictModel):
    """How to rebuild a home: a room type and a seed.

    `sha256` is that of the shapes and places of what they make, so that another version of the
    generator cannot pass for the one that the task was made with.
    """

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


class FileSource(StrictModel):
    """How to find a home that is kept in a GLB file; relative to the folder of the script."""

    file: str
    sha256: str

    def load(self, folder: Path) -> Home:
        """The home.

        Raises:
            OSError: The file cannot be read.
            ValueError: It is another file, or no home.
        """
        path = _glb(folder / self.file)
        if Path(self.file).is_absolute():
            raise ValueError(f"{self.file}: a task must name its home relative to its own folder")
        if file_digest(path) != self.sha256:
            raise ValueError(f"{path} is not the file of this task: its SHA-256 is another one")
        return load_home(path)

    @classmethod
    def of_path(cls, path: Path, folder: Path) -> tuple[FileSource, Home]:
        """The source for a script in a folder, and the home.

        Raises:
            OSError: The file cannot be read.
            ValueError: It is no home.
        """
        _glb(path)
        relative = os.path.relpath(path.resolve(), folder.resolve())
        return cls(file=Path(relative).as_posix(), sha256=file_digest(path)), load_home(path)


def open_home(name: str, seed: int) -> Home:
    """The home of a room type and a seed, or of a file.

    Raises:
        OSError: The file cannot be read.
        ValueError: There is no such room type, or the file is no home.
    """
    if Path(name).suffix.lower() in FILE_TYPES:
        return load_home(Path(name))
    require_room_type(name)
    return make_home(name, seed)


def require_room_type(name: str) -> None:
    """Raises ValueError if a name is no room type."""
    if name not in ROOM_TYPES:
        expected = ", ".join(ROOM_TYPES)
        raise ValueError(f"expected one of {expected} or a .glb or .gltf file, got {name!r}")


def _glb(path: Path) -> Path:
    """The path, if it is a regular file that holds a whole home in itself."""
    if path.suffix.lower() != ".glb":
        raise ValueError(f"{path}: tasks need a .glb file, which holds all of its home")
    if not path.is_file():
        raise FileNotFoundError(f"{path}: there is no such file")
    if path.stat().st_size > FILE_BYTES:
        raise ValueError(f"{path}: larger than {FILE_BYTES >> 20} MiB")
    return path


def shape_digest(home: Home) -> str:
    """SHA-256 of the objects of a home, their shapes and places, in hexadecimal digits.

    Textures are left out: they come from sums whose last bits may differ between machines.
    """
    result = hashlib.sha256(home.name.encode())
    for thing in home.objects:
        result.update(
            repr((thing.id, thing.type, thing.movable, thing.receptacle, thing.parent)).encode()
        )
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
