"""References to homes in scripts, by which another machine rebuilds the same home."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Annotated

from pydantic import Field

from gslts_sim.gltf.file import MAX_FILE_BYTES
from gslts_sim.gltf.load import load_home
from gslts_sim.home import Home
from gslts_sim.procedural.homes import HOME_TYPES, make_home
from gslts_sim.strict_model import StrictModel

FILE_TYPES = (".glb", ".gltf")
"""Suffixes of files that hold homes."""
COARSE = 0.05
"""Scale of the texture resolution where only shapes matter; makes a home several times as fast."""


class HomeSource(StrictModel):
    """Reference to a generated home: a room type and a seed.

    `sha256` is the digest of its shapes and poses: it detects another version of the generator.
    """

    room_type: str
    seed: Annotated[int, Field(ge=0)]
    sha256: str

    @classmethod
    def of_seed(cls, room_type: str, seed: int) -> tuple[HomeSource, Home]:
        """Return the reference to a home, and the home with coarse textures.

        Args:
            room_type: One of `HOME_TYPES`.
            seed: Seed of the home.

        Raises:
            ValueError: There is no such room type.
        """
        home = make_home(room_type, seed, detail=COARSE)
        return cls(room_type=room_type, seed=seed, sha256=shape_digest(home)), home

    def load(self, _folder: Path) -> Home:
        """Generate the home.

        Args:
            _folder: Ignored; as in `FileSource.load`.

        Raises:
            ValueError: It cannot be generated, or its digest differs.
        """
        home = make_home(self.room_type, self.seed)
        if shape_digest(home) != self.sha256:
            raise ValueError(
                f"{home.name} is not the home of this task: another version of gslts made it"
            )
        return home


class FileSource(StrictModel):
    """Reference to a home in a GLB file, by its path relative to the folder of the script."""

    file: str
    sha256: str

    def load(self, folder: Path) -> Home:
        """Read the home.

        Args:
            folder: Folder of the script.

        Raises:
            OSError: The file cannot be read.
            ValueError: Its digest differs, or it is not a home.
        """
        path = _glb(folder / self.file)
        if Path(self.file).is_absolute():
            raise ValueError(f"{self.file}: a task must name its home relative to its own folder")
        if file_digest(path) != self.sha256:
            raise ValueError(f"{path} is not the file of this task: its SHA-256 is another one")
        return load_home(path)

    @classmethod
    def of_path(cls, path: Path, folder: Path) -> tuple[FileSource, Home]:
        """Return the reference to a file, and the home that it holds.

        Args:
            path: A GLB file.
            folder: Folder of the script.

        Raises:
            OSError: The file cannot be read.
            ValueError: It is not a home.
        """
        _glb(path)
        relative = os.path.relpath(path.resolve(), folder.resolve())
        return cls(file=Path(relative).as_posix(), sha256=file_digest(path)), load_home(path)


def open_home(name: str, seed: int) -> Home:
    """Generate a home, or read it from a file.

    Args:
        name: One of `HOME_TYPES`, or the path of a .glb or .gltf file.
        seed: Seed of a generated home.

    Raises:
        OSError: The file cannot be read.
        ValueError: There is no such room type, or the file is not a home.
    """
    if Path(name).suffix.lower() in FILE_TYPES:
        return load_home(Path(name))
    require_room_type(name)
    return make_home(name, seed)


def require_room_type(name: str) -> None:
    """Raise ValueError unless a name is a room type.

    Args:
        name: To be checked.
    """
    if name not in HOME_TYPES:
        expected = ", ".join(HOME_TYPES)
        raise ValueError(f"expected one of {expected} or a .glb or .gltf file, got {name!r}")


def _glb(path: Path) -> Path:
    """Return the path of a regular, self-contained file, or raise."""
    if path.suffix.lower() != ".glb":
        raise ValueError(f"{path}: tasks need a .glb file, which holds all of its home")
    if not path.is_file():
        raise FileNotFoundError(f"{path}: there is no such file")
    if path.stat().st_size > MAX_FILE_BYTES:
        raise ValueError(f"{path}: larger than {MAX_FILE_BYTES >> 20} MiB")
    return path


def shape_digest(home: Home) -> str:
    """Compute the SHA-256 of the shapes and poses of a home's objects.

    Textures are left out: they come from sums whose last bits may differ between machines.

    Args:
        home: The home.

    Returns:
        Hexadecimal digits.
    """
    result = hashlib.sha256(home.name.encode())
    for obj in home.objects:
        result.update(repr((obj.id, obj.type, obj.movable, obj.receptacle, obj.parent)).encode())
        for array in (obj.boxes, obj.world_from_object):
            result.update(array.tobytes())
        for surface in obj.surfaces:
            result.update(surface.vertices.tobytes())
            result.update(surface.faces.tobytes())
    return result.hexdigest()


def file_digest(path: Path) -> str:
    """Compute the SHA-256 of a file.

    Args:
        path: The file.

    Returns:
        Hexadecimal digits.

    Raises:
        OSError: It cannot be read.
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
