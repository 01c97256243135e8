"""Parts of an HTML page that needs nothing else; all texts are escaped here."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from gslts.io.atomic_files import write_whole


def write_page(path: Path, title: str, summary: str, sections: Sequence[str]) -> None:
    """Writes a page, which is there whole or not at all.

    Args:
        path: Of the page.
        title: Its heading.
        summary: What it says in a line.
        sections: From `section`; empty ones are left out.

    Raises:
        OSError: It cannot be written.
    """
    head = f"<h1>{escape(title)}</h1>\n<p class=summary>{escape(summary)}</p>"
    body = "\n".join([head, *(one for one in sections if one)])
    page = _PAGE.format(title=escape(title), style=_STYLE, body=body)
    write_whole(path, page.encode("utf-8", errors="replace"))


def section(title: str, body: str) -> str:
    """A part with a heading; empty if there is nothing in it."""
    return f"<section>\n<h2>{escape(title)}</h2>\n{body}\n</section>" if body else ""


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table, empty without rows; the first column names the row."""
    if not rows:
        return ""
    top = "".join(f"<th scope=col>{escape(one)}</th>" for one in head)
    lines = (
        f"<tr><th scope=row>{escape(row[0])}</th>"
        + "".join(f"<td>{escape(one)}</td>" for one in row[1:])
        + "</tr>"
        for row in rows
    )
    head_row = f"<thead><tr>{top}</tr></thead>\n" if head else ""
    body = "\n".join(lines)
    return f"<div class=wide><table>\n{head_row}<tbody>\n{body}\n</tbody></table></div>"


def plots(*pictures: tuple[str, str]) -> str:
    """Pictures, each what it shows and its address, side by side where there is room."""
    shown = "\n".join(f'<img alt="{escape(alt)}" src="{address}">' for alt, address in pictures)
    return f"<div class=plots>\n{shown}\n</div>"


def bullets(lines: Sequence[str]) -> str:
    """A list, empty without lines."""
    items = "\n".join(f"<li>{escape(line)}</li>" for line in lines)
    return f"<ul>\n{items}\n</ul>" if lines else ""


def pairs_table(pairs: Mapping[str, Any]) -> str:
    """A table of names and what they stand for."""
    return table([], [[str(name), str(value)] for name, value in pairs.items()])


def number(value: float | None) -> str:
    """With four significant digits, or a dash if there is none."""
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
