"""Tables of results in Markdown, and the cells in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Table:
    """Table of a result; also kept in its JSON.

    Attributes:
        title: Heading; empty for none.
        header: Names of the columns.
        rows: Cells; the first column is text, the others are aligned to the right.
        note: Sentence below the table; empty for none.
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""

    def markdown(self) -> str:
        """Format heading, table and note."""
        heading = [f"### {self.title}"] if self.title else []
        table = [markdown_table(self.header, self.rows)] if self.rows else []
        return "\n\n".join([*heading, *table, *([self.note] if self.note else [])])


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Format a table in Markdown.

    Args:
        header: Names of the columns.
        rows: Cells, as many in each row as there are columns.

    Returns:
        Lines without a newline at the end.
    """
    marks = [":--", *["--:"] * (len(header) - 1)]
    return "\n".join("| " + " | ".join(row) + " |" for row in (header, marks, *rows))


def tables_markdown(tables: Iterable[Table]) -> str:
    """Format tables one below the other.

    Args:
        tables: The tables.
    """
    return "\n\n".join(table.markdown() for table in tables)


def result_markdown(result: dict[str, Any]) -> str:
    """Format a result of `describe_run` with tables, as its JSON holds it.

    Args:
        result: JSON values with `command`, `commit`, `date`, `machine` and `tables`, a list of the
            fields of `Table`; and `seeds` with `split` or `foreign`, and `cases`, where the result
            has them.

    Returns:
        The tables in Markdown, below lines that name homes, commit, machine and command.
    """
    machine, commit = result["machine"], result["commit"] or "unknown"
    changed = " with uncommitted changes" if result.get("changed_since") else ""
    cpu = f"{machine['cpu']}, {machine['cores']} cores, {machine.get('instruction_set', '')}"
    lines = [
        f"Commit {commit[:10]}{changed}, {result['date'][:10]}; {cpu.rstrip(', ')}; "
        f"`{result['command']}`"
    ]
    if result.get("seeds"):
        first, end = result["seeds"]
        seeds = f"seed {first}" if end - first == 1 else f"seeds {first} to {end - 1}"
        if result.get("foreign"):
            files = ", ".join(f"`{name}`" for name in result["foreign"])
            lines.append(f"Foreign home {files}, not of a split of ours; tasks with {seeds}.")
        else:
            lines.append(f"Homes with {seeds}: {result['split']} split.")
    if result.get("cases"):
        lines.append(result["cases"])
    tables = tables_markdown(Table(**table) for table in result["tables"])
    return "\n\n".join(["  \n".join(lines), tables])


def share(count: int, of: int) -> str:
    """Format a share, such as `91.0 % (273 of 300)`; `-` of nothing.

    Args:
        count: Number of counted cases.
        of: Number of all cases.
    """
    return f"{100 * count / of:.1f} % ({count} of {of})" if of else "-"


def mean(total: float, of: int) -> str:
    """Format a mean with two digits; `-` of nothing.

    Args:
        total: Sum of the values.
        of: Number of values.
    """
    return f"{total / of:.2f}" if of else "-"


def number(value: float | None, digits: int, unit: str = "") -> str:
    """Format a number with its unit; `-` for None.

    Args:
        value: The number.
        digits: Number of digits.
        unit: Unit behind the number; empty for none.
    """
    return "-" if value is None else f"{value:.{digits}f}{f' {unit}' if unit else ''}"
