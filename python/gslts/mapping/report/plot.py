"""Line plots of the report, as SVG."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from math import ceil, floor, log10

WIDTH, HEIGHT = 360, 230
"""Size of a plot, px."""
LEFT, RIGHT, TOP, BOTTOM = 58, 10, 10, 42
"""Margins around the axes, px: the left one holds numbers such as 1,250,000."""
TICKS = 6
"""Maximum number of ticks on an axis; more would touch."""
INK = "#808080"
"""Colour of axes and texts: readable on white and on black."""


@dataclass(frozen=True)
class Curve:
    """Points that a line connects.

    Attributes:
        x: Values of the horizontal axis.
        y: As many values of the vertical axis.
        color: Hexadecimal colour.
        label: Name in the legend; "" for none.
        dots: Draw a dot at each point too.
        filled: Fill the area below the line.
    """

    x: Sequence[float]
    y: Sequence[float]
    color: str
    label: str = ""
    dots: bool = False
    filled: bool = False


def plot_svg(
    x_label: str, y_label: str, curves: Sequence[Curve], *, from_zero: bool = False
) -> str:
    """Plot curves.

    Args:
        x_label: Name of the horizontal axis, with the unit.
        y_label: Name of the vertical axis, with the unit.
        curves: At least one, with finite values.
        from_zero: Begin the vertical axis at 0.

    Returns:
        The text of an SVG file.
    """
    x_low, x_high = _range([x for curve in curves for x in curve.x])
    y_low, y_high = _range([y for curve in curves for y in curve.y] + [0.0] * from_zero)
    x_px = (WIDTH - LEFT - RIGHT) / (x_high - x_low)
    y_px = (HEIGHT - TOP - BOTTOM) / (y_high - y_low)

    def at(x: float, y: float) -> tuple[str, str]:
        return f"{LEFT + (x - x_low) * x_px:.1f}", f"{HEIGHT - BOTTOM - (y - y_low) * y_px:.1f}"

    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
        f'height="{HEIGHT}" font-family="sans-serif" font-size="11" fill="{INK}">',
        f'<path d="M{LEFT} {TOP}V{bottom}H{right}" fill="none" stroke="{INK}"/>',
        f'<text x="{(LEFT + right) / 2}" y="{HEIGHT - 6}" text-anchor="middle">'
        f"{escape(x_label)}</text>",
        f'<text transform="translate(12 {(TOP + bottom) / 2})rotate(-90)" text-anchor="middle">'
        f"{escape(y_label)}</text>",
    ]
    for value in _ticks(x_low, x_high):
        x, _ = at(value, y_low)
        parts.append(f'<path d="M{x} {TOP}V{bottom}" stroke="{INK}" opacity=".25"/>')
        parts.append(f'<text x="{x}" y="{bottom + 15}" text-anchor="middle">{value:,g}</text>')
    for value in _ticks(y_low, y_high):
        _, y = at(x_low, value)
        parts.append(f'<path d="M{LEFT} {y}H{right}" stroke="{INK}" opacity=".25"/>')
        parts.append(f'<text x="{LEFT - 5}" y="{y}" dy=".35em" text-anchor="end">{value:,g}</text>')
    for curve in curves:
        points = [at(x, y) for x, y in zip(curve.x, curve.y, strict=True)]
        line = "M" + "L".join(" ".join(point) for point in points)
        if curve.filled:
            parts.append(f'<path d="{line}V{bottom}H{points[0][0]}Z" fill="{curve.color}"/>')
        else:
            parts.append(
                f'<path d="{line}" fill="none" stroke="{curve.color}" stroke-width="1.5"/>'
            )
        if curve.dots:
            parts += [f'<circle cx="{x}" cy="{y}" r="2" fill="{curve.color}"/>' for x, y in points]
    parts += _legend([curve for curve in curves if curve.label])
    return "".join(parts) + "</svg>"


def _legend(curves: Sequence[Curve]) -> Iterator[str]:
    for row, curve in enumerate(reversed(curves)):
        y = HEIGHT - BOTTOM - 10 - 15 * row
        yield (
            f'<text x="{WIDTH - RIGHT - 5}" y="{y}" text-anchor="end" fill="{curve.color}">'
            f"{escape(curve.label)}</text>"
        )


def _range(values: Sequence[float]) -> tuple[float, float]:
    low, high = min(values), max(values)
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def _ticks(low: float, high: float) -> list[float]:
    """Return multiples of 1, 2 or 5 times a power of ten between two values."""
    raw = (high - low) / TICKS
    power = 10.0 ** floor(log10(raw))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= raw)
    return [round(k * step, 12) for k in range(ceil(low / step), floor(high / step) + 1)]
