"""Self-contained HTML pages: heading, sections, tables, plots. All texts are escaped here."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from gslts.io.atomic_files import write_atomic


def write_page(path: Path, title: str, summary: str, sections: Sequence[str]) -> None:
    """Write a page atomically.

    Args:
        path: File of the page.
        title: Heading.
        summary: One line below the heading.
        sections: From `section`; empty strings are skipped.

    Raises:
        OSError: The file cannot be written.
    """
    write_atomic(path, make_page(title, summary, sections))


def make_page(title: str, summary: str, sections: Sequence[str]) -> bytes:
    """Make a page.

    Args:
        title: Heading.
        summary: Line below the heading.
        sections: From `section`; empty strings are skipped.

    Returns:
        HTML in UTF-8.
    """
    head = f"<h1>{escape(title)}</h1>\n<p class=summary>{escape(summary)}</p>"
    body = "\n".join([head, *filter(None, sections)])
    page = _PAGE.format(title=escape(title), style=_STYLE, body=body)
    return page.encode("utf-8", errors="replace")


def section(title: str, body: str) -> str:
    """Return a section with a heading; "" if its body is empty.

    Args:
        title: Heading, plain text.
        body: HTML.
    """
    return f"<section>\n<h2>{escape(title)}</h2>\n{body}\n</section>" if body else ""


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table; "" without rows.

    Args:
        head: Titles of the columns; empty for none.
        rows: Plain texts; the first column is the title of the row.
    """
    if not rows:
        return ""
    top = "".join(f"<th scope=col>{escape(title)}</th>" for title in head)
    lines = (
        f"<tr><th scope=row>{escape(row[0])}</th>"
        + "".join(f"<td>{escape(cell)}</td>" for cell in row[1:])
        + "</tr>"
        for row in rows
    )
    head_row = f"<thead><tr>{top}</tr></thead>\n" if head else ""
    body = "\n".join(lines)
    return f"<div class=wide><table>\n{head_row}<tbody>\n{body}\n</tbody></table></div>"


def plots(*images: tuple[str, str]) -> str:
    """Return images side by side where the window is wide enough.

    Args:
        images: For each its alternative text and its address.
    """
    tags = "\n".join(f'<img alt="{escape(alt)}" src="{address}">' for alt, address in images)
    return f"<div class=plots>\n{tags}\n</div>"


def bullets(lines: Sequence[str]) -> str:
    """Return a list; "" without lines.

    Args:
        lines: Plain texts.
    """
    items = "\n".join(f"<li>{escape(line)}</li>" for line in lines)
    return f"<ul>\n{items}\n</ul>" if lines else ""


def pairs_table(pairs: Mapping[str, Any]) -> str:
    """Return a table of names and values.

    Args:
        pairs: Names and values, converted by `str`.
    """
    return table([], [[str(name), str(value)] for name, value in pairs.items()])


def number(value: float | None) -> str:
    """Format a number with four significant digits; a dash for None or NaN.

    Args:
        value: Number to format.
    """
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.4g}" if abs(value) < 1000 else f"{value:,.0f}"


_PAGE = """\
<!doctype html>
<html lang=en>
<head>
<meta charset=utf-8>
<meta name=viewport content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
{body}
</body>
</html>
"""
"""Frame of all pages."""

_STYLE = """\
:root { color-scheme: light dark; --text: #222; --quiet: #666; --back: #fff; --line: #ddd; }
@media (prefers-color-scheme: dark) {
  :root { --text: #ddd; --quiet: #999; --back: #181818; --line: #3a3a3a; }
}
body { font: 16px/1.5 system-ui, sans-serif; color: var(--text); background: var(--back);
  max-width: 1400px; margin: 0 auto; padding: 1rem; overflow-wrap: anywhere; }
h1, h2, h3 { line-height: 1.2; font-weight: 600; }
h1 { margin: .5rem 0; }
h2 { margin: 2.5rem 0 .75rem; border-bottom: 1px solid var(--line); }
h3 { margin: 1.5rem 0 .4rem; font-size: 1rem; }
h3 span, figcaption { color: var(--quiet); font-weight: 400; font-size: .875rem; }
.summary { font-size: 1.125rem; margin: 0; }
.wide { overflow-x: auto; max-width: 100%; }
table { border-collapse: collapse; margin: .5rem 0; }
th, td { padding: .25rem .9rem .25rem 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid var(--line); font-variant-numeric: tabular-nums;
  overflow-wrap: normal; }
th { font-weight: 400; color: var(--quiet); }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 330px), 520px)); }
.plots img { width: 100%; }
.legend { width: 8rem; height: .75rem; }
.view { display: grid; grid-template-columns: repeat(auto-fit, minmax(150px, 1fr)); gap: .5rem; }
figure { margin: 0; }
figure img { width: 100%; display: block; }
"""
"""Style of all pages, for light and dark screens, without scripts or other files."""
