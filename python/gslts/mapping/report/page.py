"""Report of a mapping run as one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import numpy as np

from gslts.io.data_urls import jpeg_of, png_of
from gslts.io.html_page import bullets, number, pairs_table, plots, section, table, write_page
from gslts.io.images import (
    DEPTH_COLORS,
    ERROR_COLORS,
    depth_image,
    depth_range,
    error_image,
    legend,
)
from gslts.mapping.report.data import MAX_VIEWS, CurvePoint, ReportData, View
from gslts.mapping.report.images import (
    histogram_svg,
    psnr_svg,
    shrink,
    size_svg,
)

__all__ = ["CurvePoint", "ReportData", "View", "write_report"]

MAX_ERROR = 0.2
"""Colour difference (of 1) that is drawn brightest in error images."""


def write_report(path: Path, report: ReportData) -> None:
    """Write the page atomically.

    Args:
        path: HTML file.
        report: Content.

    Raises:
        OSError: The file cannot be written.
        ValueError: The images of a view differ in size.
    """
    sections = [
        section("Quality on test frames", _metrics(report.metrics)),
        section("Variants, compared on validation frames", _variants(report.variants)),
        section("Optimization", _curves(report.curve)),
        section("Camera and poses", _findings(report)),
        section("Test frames", _views(report.views)),
        section("Held-out frames", pairs_table(_join(report.frames))),
        section("Skipped frames", bullets(report.skipped)),
        section("Settings", pairs_table(report.config)),
    ]
    write_page(path, report.title, report.summary, sections)


def _metrics(metrics: Mapping[str, Mapping[str, float]]) -> str:
    names = list(dict.fromkeys(name for values in metrics.values() for name in values))
    rows = [
        [poses, *(number(values.get(name)) for name in names)] for poses, values in metrics.items()
    ]
    return table(["", *names], rows)


def _variants(variants: Sequence[tuple[str, int, float]]) -> str:
    rows = [[name, f"{count:,}", number(psnr_db)] for name, count, psnr_db in variants]
    return table(["", "Gaussians", "validation PSNR, dB"], rows)


def _join(frames: Mapping[str, Sequence[str]]) -> dict[str, str]:
    return {purpose: ", ".join(names) for purpose, names in frames.items()}


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
            for name, values in (("shift, cm", shifts_cm), ("rotation, degrees", turns_deg))
        ]
        parts.append(table(["corrections of poses", "median", "maximum"], rows))
        parts.append(
            plots(
                ("Histogram of the shifts", histogram_svg(shifts_cm, "shift, cm")),
                ("Histogram of the rotations", histogram_svg(turns_deg, "rotation, degrees")),
            )
        )
    return "\n".join(part for part in parts if part)


def _views(views: Sequence[View]) -> str:
    if not views:
        return ""
    chosen = np.unique(np.linspace(0, len(views) - 1, min(len(views), MAX_VIEWS)).astype(int))
    left_out = f" {len(chosen)} of {len(views)} are shown." if len(chosen) < len(views) else ""
    error, depth = (png_of(legend(colors)) for colors in (ERROR_COLORS, DEPTH_COLORS))
    legends = (
        "<p>The exposure of the photograph is applied to the rendering."
        f"{left_out}</p>\n"
        f'<p>Error: 0 <img class=legend alt="black to yellow" src="{error}"> {MAX_ERROR:g} of '
        "the whole range, mean of the channels; 0 where the camera saw nothing.<br>\n"
        f'Depth: near <img class=legend alt="red to blue" src="{depth}"> far; grey where there is '
        "none.</p>"
    )
    return "\n".join([legends, *(_view(views[row]) for row in chosen)])


def _view(view: View) -> str:
    size = view.photo.shape[:2]
    mask = np.ones(size, np.bool_) if view.mask is None else view.mask
    if any(
        image.shape[:2] != size
        for image in (view.render, view.measured_depth, view.rendered_depth, mask)
    ):
        raise ValueError(f"write_report: the images of view {view.name!r} differ in size")
    comparable = np.where(mask[..., None], view.render, view.photo)
    error = error_image(comparable, view.photo, MAX_ERROR)
    measured, rendered = (shrink(depth) for depth in (view.measured_depth, view.rendered_depth))
    range_m = depth_range(measured if (measured > 0).any() else rendered)
    figures = (
        ("photograph", shrink(view.photo)),
        ("rendering", shrink(view.render)),
        ("error", shrink(error)),
        ("measured depth", depth_image(measured, range_m)),
        ("rendered depth", depth_image(rendered, range_m)),
    )
    name = escape(view.name)
    shown = "\n".join(
        f'<figure><img loading=lazy alt="{caption} of {name}" src="{jpeg_of(image)}">'
        f"<figcaption>{caption}</figcaption></figure>"
        for caption, image in figures
    )
    scale = f"depth {range_m[0]:.2f} to {range_m[1]:.2f} m"
    title = f"<h3>{name} <span>{number(view.psnr_db)} dB, {scale}</span></h3>"
    return f"{title}\n<div class=view>\n{shown}\n</div>"
