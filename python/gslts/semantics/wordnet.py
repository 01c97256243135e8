"""Synonyms and singular forms of English nouns, from the files of WordNet where they are installed.

Formats: wndb(5WN) and morphy(7WN) of WordNet 3.0 (Fellbaum 1998); Debian has them in the package
wordnet-base.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

FOLDER_VARIABLE, FOLDER = "WNSEARCHDIR", "/usr/share/wordnet"
"""Environment variable of WordNet that names the folder of its files, and where Debian has them."""
MAX_FILE_BYTES = 1 << 26
"""Maximum size of a file, 64 MiB; the largest of WordNet 3.0 has 15 MB."""
MAX_MEANINGS = 2
"""Number of meanings of a noun, the most frequent first, that have synonyms: a stool is a seat, and
only fourth a toilet."""
ENDINGS = (
    ("ches", "ch"),
    ("shes", "sh"),
    ("ses", "s"),
    ("xes", "x"),
    ("zes", "z"),
    ("ves", "f"),
    ("ves", "fe"),
    ("oes", "o"),
    ("ies", "y"),
    ("men", "man"),
    ("s", ""),
)
"""Endings of plurals and of their singulars: the rules of detachment of morphy(7WN), and -ves
and -oes, which WordNet lists word by word."""
IRREGULAR = {"mice": ("mouse",), "people": ("person",)}
"""Irregular plurals of classes of COCO, which are understood without WordNet."""


def singular_forms(text: str) -> list[str]:
    """Return what the singular of a noun may be.

    Args:
        text: A noun, or several words that end with one, such as "wine glasses".

    Returns:
        Candidates, some of which are no words; none if the text ends like no plural.
    """
    word = text.strip().casefold()
    first, _, last = word.rpartition(" ")
    forms = [*_exceptions().get(last, ()), *IRREGULAR.get(last, ())]
    forms += [last.removesuffix(end) + new for end, new in ENDINGS if last.endswith(end)]
    return [f"{first} {form}".strip() for form in forms if form]


def noun_synonyms(text: str) -> tuple[str, ...]:
    """Return the nouns that have a meaning in common with a text.

    Args:
        text: A noun in the singular, such as "couch" or "dining table".

    Returns:
        Nouns, those of its most frequent meaning first; with the text itself. Empty if it is no
        noun of WordNet, or if WordNet is not installed.

    Raises:
        OSError: A file of WordNet cannot be read.
        ValueError: A file of WordNet is damaged.
    """
    folder = _folder()
    offsets = _index(folder).get("_".join(text.casefold().split()), ()) if folder else ()
    if folder is None or not offsets:
        return ()
    words: list[str] = []
    path = folder / "data.noun"
    with _naming(path), path.open("rb") as file:
        for offset in offsets[:MAX_MEANINGS]:
            file.seek(offset)
            # Offset, file, type, number of words, then each word with its sense.
            fields = file.readline(1 << 16).decode("ascii", "replace").split(" ")
            if int(fields[0]) != offset:
                raise ValueError("another line begins here")
            count = int(fields[3], 16)
            words += [word.replace("_", " ") for word in fields[4 : 4 + 2 * count : 2]]
    return tuple(dict.fromkeys(words))


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Name the file in the error of a line that does not have its format."""
    try:
        yield
    except (ValueError, IndexError):
        raise ValueError(
            f"{path}: it is no file of WordNet, or damaged; install it again, or name another "
            f"folder in {FOLDER_VARIABLE}"
        ) from None


def _folder() -> Path | None:
    """Return the folder of WordNet's nouns, if it is there."""
    folder = Path(os.environ.get(FOLDER_VARIABLE) or FOLDER)
    files = [folder / name for name in ("index.noun", "data.noun", "noun.exc")]
    return folder if all(_is_readable(path) for path in files) else None


def _is_readable(path: Path) -> bool:
    return path.is_file() and path.stat().st_size <= MAX_FILE_BYTES


@cache
def _index(folder: Path) -> dict[str, tuple[int, ...]]:
    """Return the offsets of the meanings of each noun in `data.noun`."""
    index = {}
    path = folder / "index.noun"
    with _naming(path), path.open(encoding="ascii", errors="replace") as file:
        for line in file:
            if not line.startswith(" "):  # The licence.
                word, _, meanings, *rest = line.split()
                index[word] = tuple(int(offset) for offset in rest[-int(meanings) :])
    return index


def _exceptions() -> dict[str, tuple[str, ...]]:
    folder = _folder()
    return {} if folder is None else _read_exceptions(folder)


@cache
def _read_exceptions(folder: Path) -> dict[str, tuple[str, ...]]:
    """Return the singular forms of irregular plurals."""
    lines = (folder / "noun.exc").read_text(encoding="ascii", errors="replace").splitlines()
    return {plural: tuple(singulars) for plural, *singulars in map(str.split, lines) if singulars}
