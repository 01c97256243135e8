"""What a run of the mapping engine found out, as one HTML page that needs nothing else."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from gslts.files import write_whole
from gslts.mapping.report_data import MOST_VIEWS, CurvePoint, ReportData, View
from gslts.mapping.report_pictures import (
    histogram_svg,
    jpeg_of,
    png_of,
    psnr_svg,
    size_svg,
    smaller,
)
from gslts.pictures import (
    DEPTH_COLORS,
    ERROR_COLORS,
    depth_picture,
    depth_range,
    error_picture,
    legend,
)

__all__ = ["CurvePoint", "ReportData", "View", "write_report"]

ERROR_SHOWN = 0.2
"""Difference of the colours, of 1, that is drawn brightest."""


def write_report(path: Path, report: ReportData) -> None:
    """Writes the page, which is there whole or not at all.

    Raises:
        OSError: It cannot be written.
        ValueError: The pictures of a view differ in size.
    """
    parts = [
        f"<h1>{escape(report.title)}</h1>\n<p class=summary>{escape(report.summary)}</p>",
        _section("How well it shows frames kept aside", _metrics(report.metrics)),
        _section("How many Gaussians are needed", _sizes(report.gaussians_needed)),
        _section("How it learned", _curves(report.curve)),
        _section("What was found about the camera", _findings(report)),
        _section("Frames kept aside", _views(report.views)),
        _section("Frames that were not used", _list(report.skipped)),
        _section("Settings", _pairs(report.config)),
    ]
    title = escape(report.title)
    page = _PAGE.format(title=title, style=_STYLE, body="\n".join(part for part in parts if part))
    write_whole(path, page.encode("utf-8", errors="replace"))


def _section(title: str, body: str) -> str:
    return f"<section>\n<h2>{title}</h2>\n{body}\n</section>" if body else ""


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Of texts that are escaped here; the first column names the row."""
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


def _metrics(metrics: Mapping[str, Mapping[str, float]]) -> str:
    names = list(dict.fromkeys(name for values in metrics.values() for name in values))
    rows = [
        [way, *(_number(values.get(name)) for name in names)] for way, values in metrics.items()
    ]
    return _table(["", *names], rows)


def _sizes(sizes: Sequence[tuple[str, int, float]]) -> str:
    rows = [[name, f"{count:,}", _number(psnr_db)] for name, count, psnr_db in sizes]
    return _table(["", "Gaussians", "PSNR, dB"], rows)


def _curves(curve: Sequence[CurvePoint]) -> str:
    if len(curve) < 2:
        return ""
    return _plots(("PSNR over time", psnr_svg(curve)), ("Gaussians over time", size_svg(curve)))


def _plots(*plots: tuple[str, str]) -> str:
    """Pictures with what they show, side by side where there is room."""
    shown = "\n".join(f'<img alt="{alt}" src="{address}">' for alt, address in plots)
    return f"<div class=plots>\n{shown}\n</div>"


def _findings(report: ReportData) -> str:
    parts = [_pairs(report.findings)]
    shifts_cm = 100 * np.array(report.pose_shifts_m, np.float64)
    turns_deg = np.rad2deg(np.array(report.pose_turns_rad, np.float64))
    if shifts_cm.size and turns_deg.size:
        rows = [
            [name, _number(float(np.median(values))), _number(float(values.max()))]
            for name, values in (("shift, cm", shifts_cm), ("turn, degrees", turns_deg))
        ]
        parts.append(_table(["corrections of poses", "median", "greatest"], rows))
        parts.append(
            _plots(
                ("Histogram of the shifts", histogram_svg(shifts_cm, "shift, cm")),
                ("Histogram of the turns", histogram_svg(turns_deg, "turn, degrees")),
            )
        )
    return "\n".join(part for part in parts if part)


def _views(views: Sequence[View]) -> str:
    if not views:
        return ""
    chosen = np.unique(np.linspace(0, len(views) - 1, min(len(views), MOST_VIEWS)).astype(int))
    left_out = f" {len(chosen)} of {len(views)} are shown." if len(chosen) < len(views) else ""
    error, depth = (png_of(legend(colors)) for colors in (ERROR_COLORS, DEPTH_COLORS))
    legends = (
        "<p>The exposure of the photograph is applied to the rendering."
        f"{left_out}</p>\n"
        f'<p>Error: 0 <img class=legend alt="black to yellow" src="{error}"> {ERROR_SHOWN:g} of '
        "the whole range, mean of the channels.<br>\n"
        f'Depth: near <img class=legend alt="red to blue" src="{depth}"> far; grey where there is '
        "none.</p>"
    )
    return "\n".join([legends, *(_view(views[row]) for row in chosen)])


def _view(view: View) -> str:
    size = view.photo.shape[:2]
    if any(
        picture.shape[:2] != size
        for picture in (view.render, view.measured_depth, view.rendered_depth)
    ):
        raise ValueError(f"write_report: the pictures of view {view.name!r} differ in size")
    error = error_picture(view.render, view.photo, ERROR_SHOWN)
    measured, rendered = (smaller(one) for one in (view.measured_depth, view.rendered_depth))
    range_m = depth_range(measured if (measured > 0).any() else rendered)
    figures = (
        ("photograph", smaller(view.photo)),
        ("rendering", smaller(view.render)),
        ("error", smaller(error)),
        ("measured depth", depth_picture(measured, range_m)),
        ("rendered depth", depth_picture(rendered, range_m)),
    )
    name = escape(view.name)
    shown = "\n".join(
        f'<figure><img loading=lazy alt="{caption} of {name}" src="{jpeg_of(picture)}">'
        f"<figcaption>{caption}</figcaption></figure>"
        for caption, picture in figures
    )
    scale = f"depth {range_m[0]:.2f} to {range_m[1]:.2f} m"
    title = f"<h3>{name} <span>{_number(view.psnr_db)} dB, {scale}</span></h3>"
    return f"{title}\n<div class=view>\n{shown}\n</div>"


def _list(lines: Sequence[str]) -> str:
    items = "\n".join(f"<li>{escape(line)}</li>" for line in lines)
    return f"<ul>\n{items}\n</ul>" if lines else ""


def _pairs(pairs: Mapping[str, Any]) -> str:
    return _table([], [[str(name), str(value)] for name, value in pairs.items()])


def _number(value: float | None) -> str:
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
.wide { overflow-x: auto; }
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
