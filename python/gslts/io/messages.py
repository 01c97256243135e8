"""Messages for people. Does not import pydantic."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic import ValidationError


def to_line(text: str) -> str:
    """Return a text in one line, with escapes for characters that could control a terminal.

    Args:
        text: A message, which may hold names from untrusted files.
    """
    line = " ".join(text.split())
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in line)


def first_problem(error: ValidationError) -> str:
    """Describe the first problem of a validation error in one line.

    Args:
        error: From pydantic.

    Returns:
        The path of the field, the message, and the value if it is short.
    """
    first = error.errors(include_url=False, include_context=False)[0]
    field, value = ".".join(str(part) for part in first["loc"]), first["input"]
    if not field:
        return first["msg"]
    if not isinstance(value, str | int | float):  # Others may be as long as the file.
        return f"{field}: {first['msg']}"
    return f"{field}: {first['msg']}, got {value!r:.40}"
