"""What a run of the mapping engine found out, as one HTML page that needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import numpy as np

from gslts.io.html_page import bullets, number, pairs_table, plots, section, table, write_page
from gslts.io.images import (
    DEPTH_COLORS,
    ERROR_COLORS,
    depth_image,
    depth_range,
    error_image,
    legend,
)
from gslts.mapping.report.data import MOST_VIEWS, CurvePoint, ReportData, View
from gslts.mapping.report.images import (
    histogram_svg,
    jpeg_of,
    png_of,
    psnr_svg,
    size_svg,
    smaller,
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
    sections = [
        section("How well it shows frames kept aside", _metrics(report.metrics)),
        section("How many Gaussians are needed", _sizes(report.gaussians_needed)),
        section("How it learned", _curves(report.curve)),
        section("What was found about the camera", _findings(report)),
        section("Frames kept aside", _views(report.views)),
        section("Frames that were not used", bullets(report.skipped)),
        section("Settings", pairs_table(report.config)),
    ]
    write_page(path, report.title, report.summary, sections)


def _metrics(metrics: Mapping[str, Mapping[str, float]]) -> str:
    names = list(dict.fromkeys(name for values in metrics.values() for name in values))
    rows = [[way, *(number(values.get(name)) for name in names)] for way, values in metrics.items()]
    return table(["", *names], rows)


def _sizes(sizes: Sequence[tuple[str, int, float]]) -> str:
    rows = [[name, f"{count:,}", number(psnr_db)] for name, count, psnr_db in sizes]
    return table(["", "Gaussians", "PSNR, dB"], rows)


def _curves(curve: Sequence[CurvePoint]) -> str:
    if len(curve) < 2:
        return ""
    return plots(("PSNR over time", psnr_svg(curve)), ("Gaussians over time", size_svg(curve)))


def _findings(report: ReportData) -> str:
    parts = [pairs_table(report.findings)]
    shifts_cm = 100 * np.array(report.pose_shifts_m, np.float64)
    turns_deg = np.rad2deg(np.array(report.pose_turns_rad, np.float64))
    if shifts_cm.size and turns_deg.size:
        rows = [
            [name, number(float(np.median(values))), number(float(values.max()))]
            for name, values in (("shift, cm", shifts_cm), ("turn, degrees", turns_deg))
        ]
        parts.append(table(["corrections of poses", "median", "greatest"], rows))
        parts.append(
            plots(
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
        "the whole range, mean of the channels; 0 where the camera saw nothing.<br>\n"
        f'Depth: near <img class=legend alt="red to blue" src="{depth}"> far; grey where there is '
        "none.</p>"
    )
    return "\n".join([legends, *(_view(views[row]) for row in chosen)])


def _view(view: View) -> str:
    size = view.photo.shape[:2]
    mask = np.ones(size, np.bool_) if view.mask is None else view.mask
    if any(
        picture.shape[:2] != size
        for picture in (view.render, view.measured_depth, view.rendered_depth, mask)
    ):
        raise ValueError(f"write_report: the pictures of view {view.name!r} differ in size")
    comparable = np.where(mask[..., None], view.render, view.photo)
    error = error_image(comparable, view.photo, ERROR_SHOWN)
    measured, rendered = (smaller(one) for one in (view.measured_depth, view.rendered_depth))
    range_m = depth_range(measured if (measured > 0).any() else rendered)
    figures = (
        ("photograph", smaller(view.photo)),
        ("rendering", smaller(view.render)),
        ("error", smaller(error)),
        ("measured depth", depth_image(measured, range_m)),
        ("rendered depth", depth_image(rendered, range_m)),
    )
    name = escape(view.name)
    shown = "\n".join(
        f'<figure><img loading=lazy alt="{caption} of {name}" src="{jpeg_of(picture)}">'
        f"<figcaption>{caption}</figcaption></figure>"
        for caption, picture in figures
    )
    scale = f"depth {range_m[0]:.2f} to {range_m[1]:.2f} m"
    title = f"<h3>{name} <span>{number(view.psnr_db)} dB, {scale}</span></h3>"
    return f"{title}\n<div class=view>\n{shown}\n</div>"
