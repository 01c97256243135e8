"""Names of the classes of a detector, and the class that a text means."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from gslts.semantics.vocabulary import REJECTED_SHARE, UNRELATED
from gslts.semantics.wordnet import noun_synonyms, singular_forms
from gslts.types import Floats32, Indices

MAX_CLASSES = 128
"""Maximum number of classes of a map: each takes 4 bytes per Gaussian, COCO has 80."""
MAX_FILE_BYTES, MAX_NAME_CHARACTERS = 1 << 20, 100
"""Maximum sizes of a file of names and of a name."""
LEFT_OUT = "#"
"""Beginning of the line of a class that a map shall not have."""


class Texts(Protocol):
    """Embeds texts."""

    def encode(self, texts: Sequence[str]) -> Floats32:
        """Embed texts.

        Args:
            texts: Words or sentences.

        Returns:
            [T,D] float32, of unit length.
        """
        ...


@dataclass(frozen=True)
class Understood:
    """Class that a text means.

    Attributes:
        name: Of the class.
        reason: "name" if the text is the name or its plural, "synonym", "kind" for a text such as
            "phone" for "cell phone", or the cosine of a text model, such as "0.83".
    """

    name: str
    reason: str


def read_class_names(path: Path) -> tuple[tuple[str, ...], Indices]:
    """Read a file of names, one per line, in the order of the classes.

    Args:
        path: Text file. Classes whose line begins with `LEFT_OUT` are left out.

    Returns:
        The names, and [C] for each class of the detector its row in them, -1 if left out.

    Raises:
        OSError: The file cannot be read.
        ValueError: A name is missing, occurs twice or is too long, or there are too many or none.
    """
    if path.stat().st_size > MAX_FILE_BYTES:
        raise ValueError(f"{path}: it is larger than {MAX_FILE_BYTES >> 20} MiB: no file of names")
    try:
        lines = path.read_text(encoding="utf-8").rstrip().splitlines()
    except UnicodeDecodeError:
        raise ValueError(f"{path}: it is no text in UTF-8; expected one name per line") from None
    lines = [line.strip() for line in lines]
    names = tuple(line for line in lines if not line.startswith(LEFT_OUT))
    if not names:
        raise ValueError(f"{path}: it has no name; expected one per line")
    if len(names) > MAX_CLASSES:
        raise ValueError(
            f"{path}: {len(names)} classes are more than the {MAX_CLASSES} that a map can "
            f"have; put {LEFT_OUT} before the names of those that it shall not have"
        )
    for number, line in enumerate(lines, start=1):
        if not line or len(line) > MAX_NAME_CHARACTERS or not line.isprintable():
            raise ValueError(f"{path}: line {number} is no name: {line[:MAX_NAME_CHARACTERS]!r}")
    name, count = Counter(map(_key, names)).most_common(1)[0]
    if count > 1:
        raise ValueError(f"{path}: the name {name!r} occurs {count} times")
    is_kept = np.array([not line.startswith(LEFT_OUT) for line in lines])
    return names, np.where(is_kept, np.cumsum(is_kept) - 1, -1)


class ClassNames:
    """Names of classes, to which texts are matched: names, plurals, synonyms, then a text model.

    Args:
        names: The names, each once.
        text_model: Embeds texts; None for none.

    Attributes:
        names: The names.
    """

    def __init__(self, names: Sequence[str], text_model: Texts | None = None) -> None:
        self.names = tuple(names)
        self._by_key = {_key(name): name for name in self.names}
        self._text_model = text_model
        self._embeddings, self._threshold = None, 1.0
        if text_model is not None:
            self._embeddings = text_model.encode(self.names)
            unrelated = text_model.encode(UNRELATED) @ self._embeddings.T
            self._threshold = float(np.quantile(unrelated.max(axis=1), REJECTED_SHARE))

    def understand(self, text: str) -> Understood | None:
        """Find the class that a text means.

        Args:
            text: Such as "mug".

        Returns:
            The class; None if there is none.
        """
        forms = [text, *singular_forms(text)]
        for form in forms:
            if (name := self._by_key.get(_key(form))) is not None:
                return Understood(name, "name")
        for form in forms:
            for synonym in noun_synonyms(form):
                if (name := self._by_key.get(_key(synonym))) is not None:
                    return Understood(name, "synonym")
        kinds = {
            name
            for form in forms
            if (key := _key(form))
            for name in self.names
            if (words := _words(name.casefold()))[-1:] == [key]
            or (len(words) == 1 and _ends(words[0], key))
        }
        if len(kinds) == 1:
            return Understood(kinds.pop(), "kind")
        return self._by_model(text)

    def explain(self, text: str) -> str:
        """Explain which class a text means, unless it is its name.

        Args:
            text: Such as "mug".

        Returns:
            A sentence for the user; empty for a name.
        """
        understood = self.understand(text)
        if understood is None:
            hint = "" if self._text_model else "; --text-model DIR may know more words"
            return f'"{text}": none of the {len(self.names)} classes of the detector{hint}'
        if understood.reason == "name":
            return ""
        return f'"{text}": understood as {understood.name} ({understood.reason})'

    def _by_model(self, text: str) -> Understood | None:
        if self._text_model is None or self._embeddings is None:
            return None
        cosines = self._embeddings @ self._text_model.encode([text])[0]
        best = int(cosines.argmax())
        if cosines[best] <= self._threshold:
            return None
        return Understood(self.names[best], f"{cosines[best]:.2f}")


def _key(text: str) -> str:
    """Return a text without case, spaces, hyphens and underscores: "TV monitor" is "tvmonitor"."""
    return "".join(_words(text)).casefold()


def _words(text: str) -> list[str]:
    """Split a text at spaces, hyphens and underscores."""
    return text.replace("-", " ").replace("_", " ").split()


def _ends(name: str, key: str) -> bool:
    """Return whether a name in lower case is a compound with this end, such as "tvmonitor"."""
    first = name.removesuffix(key)
    return first not in ("", name) and bool(noun_synonyms(first))
