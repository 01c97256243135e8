"""Tables in Markdown, and shares in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table, whose columns but the first are aligned to the right."""
    marks = [":--", *["--:"] * (len(header) - 1)]
    return "\n".join("| " + " | ".join(row) + " |" for row in (header, marks, *rows))


def share(count: int, of: int) -> str:
    """Such as `91.0 % (273 of 300)`."""
    return f"{100 * count / of:.1f} % ({count} of {of})" if of else "-"


def mean(total: float, of: int) -> str:
    """Of so many things, two digits."""
    return f"{total / of:.2f}" if of else "-"
