"""Files of data sets, which are untrusted: JSON, rows of text, and names of images."""

from __future__ import annotations

import math
from pathlib import Path, PurePosixPath
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

from gslts.io.bounded_files import Readable, read_bounded
from gslts.io.messages import first_problem

MAX_LIST_BYTES = 1 << 28
"""Maximum size of a file that lists frames: 100,000 frames of nerfstudio take 60 MiB, an hour of
TUM at 30 Hz 10 MiB."""

Content = TypeVar("Content")


class MissingImageError(ValueError):
    """An image that a data set names does not exist.

    Args:
        name: Name of the image in the data set.
        kind: Kind of the image, such as "depth image".
    """

    def __init__(self, name: str, kind: str) -> None:
        super().__init__(f"{name}: there is no such {kind}")


def image_file(folder: Path, name: str, kind: str = "image") -> Path:
    """Return the path of an image that a data set names.

    Args:
        folder: Folder of the data set.
        name: Path relative to the folder.
        kind: Kind of the image, for messages.

    Raises:
        MissingImageError: The image does not exist.
        ValueError: The name leads out of the folder.
    """
    parts = PurePosixPath(name)
    if parts.is_absolute() or ".." in parts.parts:
        raise ValueError(f"the name {name[:80]!r} of an image leads out of the data set")
    path = folder / parts
    if not path.is_file():
        raise MissingImageError(name, kind)
    return path


def read_json(path: Readable, kind: type[Content]) -> Content:
    """Read a JSON file.

    Args:
        path: A file.
        kind: Type of its content, such as a pydantic model.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is too large, or its content is not of that type.
    """
    try:
        return TypeAdapter(kind).validate_json(read_bounded(path, MAX_LIST_BYTES))
    except ValidationError as error:
        raise ValueError(f"{path}: {first_problem(error)}") from None


def read_rows(path: Readable, columns: int, numbers: int) -> tuple[list[list[str]], list[str]]:
    """Read a text file with a row of values in each line, and comments after `#`.

    Args:
        path: A file.
        columns: Number of values in a row, separated by spaces.
        numbers: Number of values at the start of a row that are finite numbers.

    Returns:
        The values of each good line, and the errors of the other lines.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is too large.
    """
    rows, bad = [], []
    text = read_bounded(path, MAX_LIST_BYTES).decode(errors="replace")
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if len(words) != columns or not all(map(_is_finite, words[:numbers])):
            bad.append(f"line {number}: {line[:80]!r} is not {columns} values")
        else:
            rows.append(words)
    return rows, bad


def _is_finite(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False
