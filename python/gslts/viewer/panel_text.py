"""Text and empty images in the panel of a page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from gslts.types import Floats

EMPTY = np.full((1, 1, 3), 255, np.uint8)
"""Image of a part of the panel before there is one."""


def paragraphs(lines: Sequence[str]) -> str:
    """Return lines of text as HTML.

    Args:
        lines: Plain text.
    """
    return "".join(
        f"<p style='margin:.2em 1em;font-size:.85em;line-height:1.3'>{escape(line)}</p>"
        for line in lines
    )


def format_size(low: Sequence[float] | Floats, high: Sequence[float] | Floats) -> str:
    """Return the size of a box in words.

    Args:
        low: (3,) lower corner, m.
        high: (3,) upper corner, m.
    """
    return " x ".join(f"{size:.2f}" for size in np.subtract(high, low)) + " m"
