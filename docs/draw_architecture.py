"""Draws docs/images/architecture.svg: the data flow between packages, and their layers.

    python docs/draw_architecture.py

Captions are the first sentences of the packages' docstrings, layers those of the import contracts
in pyproject.toml; a package that is missing in the data flow is an error.
"""

from __future__ import annotations

import ast
import sys
import tomllib
from html import escape
from pathlib import Path

ROOT = Path(__file__).parent.parent
OUT = ROOT / "docs" / "images" / "architecture.svg"
WIDTH, LAYERS_TOP = 1320, 550
BOX_WIDTH, BOX_HEIGHT = 152, 164
CAPTION_CHARACTERS, CAPTION_LINES = 16, 7

BOXES = {
    "datasets": (20, 50),
    "robots": (20, 280),
    "trajectory": (205, 50),
    "mapping": (390, 50),
    "localization": (390, 280),
    "change": (575, 280),
    "update": (760, 280),
    "extension": (945, 280),
    "consolidation": (1130, 280),
    "store": (575, 50),
    "semantics": (760, 50),
    "navigation": (945, 50),
}
"""Upper left corners of the packages of the data flow, px."""
ARROWS = (
    ("datasets", "trajectory", ""),
    ("trajectory", "mapping", ""),
    ("robots", "localization", "frames"),
    ("mapping", "store", ""),
    ("localization", "change", ""),
    ("change", "update", ""),
    ("update", "store", "version"),
    ("extension", "store", ""),
    ("consolidation", "store", ""),
    ("store", "semantics", ""),
    ("semantics", "navigation", ""),
)
KEEPER = (376, 266, 920, 192)
"""Frame of the packages that the keeper runs in rounds: x, y, width, height."""
SHARED = {"core", "io", "rendering", "torch", "cli", "fleet", "keeper", "ros", "viewer"}
"""Packages that the data flow shows otherwise or not: bases, the frame, and ways to use it all."""
OUTSIDE = ("gslts_sim", "gslts_bench")


def caption(package: str) -> str:
    """Return the first sentence of the docstring of a package."""
    path = ROOT / "python" / package / "__init__.py"
    doc = ast.get_docstring(ast.parse(path.read_text())) or ""
    text = doc.split("\n\n")[0].replace("\n", " ").split(" (")[0].rstrip(".").replace("`", "")
    text = text.removeprefix(f"{Path(package).name.capitalize()}: ")
    return text[0].upper() + text[1:]


def wrap(text: str, width: int) -> list[str]:
    """Break a text into lines of at most `width` characters."""
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append(word)
        else:
            lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def box(x: float, y: float, name: str, text: str, width: float = BOX_WIDTH) -> str:
    """Return a rectangle with the name of a package and its caption."""
    lines = wrap(text, round(CAPTION_CHARACTERS * width / BOX_WIDTH))
    if len(lines) > CAPTION_LINES:
        sys.exit(f"draw_architecture: the caption of {name} has more than {CAPTION_LINES} lines")
    spans = "".join(
        f'<text x="{x + 8}" y="{y + 44 + 18 * k}" class="caption">{escape(line)}</text>'
        for k, line in enumerate(lines)
    )
    return (
        f'<rect x="{x}" y="{y}" width="{width}" height="{BOX_HEIGHT}" rx="6" class="box"/>'
        f'<text x="{x + 8}" y="{y + 22}" class="name">{escape(name)}</text>{spans}'
    )


def arrow(start: str, end: str, label: str) -> str:
    """Return an arrow between two boxes of the data flow."""
    (x0, y0), (x1, y1) = BOXES[start], BOXES[end]
    if y0 == y1:
        points = (x0 + BOX_WIDTH, y0 + BOX_HEIGHT / 2, x1, y1 + BOX_HEIGHT / 2)
    elif y0 > y1:
        points = (x0 + 40, y0, x1 + BOX_WIDTH - 30, y1 + BOX_HEIGHT)
    else:
        points = (x0 + BOX_WIDTH - 20, y0 + BOX_HEIGHT, x1 + 60, y1)
    a, b, c, d = points
    text = ""
    if label:
        text = (
            f'<text x="{(a + c) / 2}" y="{(b + d) / 2 - 6}" class="label" '
            f'text-anchor="middle">{escape(label)}</text>'
        )
    return f'<line x1="{a}" y1="{b}" x2="{c}" y2="{d}" class="arrow"/>{text}'


def layers() -> list[list[str]]:
    """Return the layers of the product package from the import contracts, the top one first."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    rows = next(each["layers"] for each in contracts["contracts"] if "containers" in each)
    names = [[name.strip(" ()") for name in row.split("|")] for row in rows]
    return [row for row in names if row not in (["types"], ["_core"], ["__main__"])]


def layer_rows(top: float) -> list[str]:
    """Return the layers as rows of boxes: a package imports only packages of lower rows."""
    parts = [f'<text x="20" y="{top - 10}" class="title">Layers: imports point downwards</text>']
    y = top
    for row in layers():
        width = (WIDTH - 280 - 10 * (len(row) - 1)) / len(row)
        for k, name in enumerate(row):
            x = 20 + k * (width + 10)
            parts.append(
                f'<rect x="{x}" y="{y}" width="{width}" height="26" rx="4" class="layer"/>'
                f'<text x="{x + 8}" y="{y + 17}" class="caption">{name}</text>'
            )
        y += 32
    for k, name in enumerate(OUTSIDE):
        parts.append(box(WIDTH - 240, top + 180 * k, name, caption(name), 220))
    return parts


def main() -> None:
    """Write the figure."""
    packages = {path.parent.name for path in (ROOT / "python" / "gslts").glob("*/__init__.py")}
    unknown = packages ^ (set(BOXES) | SHARED)
    if unknown:
        sys.exit(f"draw_architecture: the data flow and the packages differ: {sorted(unknown)}")
    x, y, width, height = KEEPER
    parts = [
        '<text x="20" y="30" class="title">Data flow</text>',
        f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="10" class="keeper"/>',
        f'<text x="{x + 8}" y="{y + height + 20}" class="label">keeper: '
        f"{escape(caption('gslts/keeper').removeprefix('Map keeper: '))}</text>",
        *(arrow(*each) for each in ARROWS),
        *(box(*BOXES[name], name, caption(f"gslts/{name}")) for name in BOXES),
        *layer_rows(LAYERS_TOP),
    ]
    style = (
        "text{font-family:system-ui,sans-serif;fill:#1b2733}.title{font-size:20px;font-weight:600}"
        ".name{font-size:18px;font-weight:600}.caption{font-size:15px}.label{font-size:15px;"
        "fill:#47586a}.box{fill:#e8f0f7;stroke:#5b7a99}.layer{fill:#f2f4f6;stroke:#b6c1cc}"
        ".keeper{fill:none;stroke:#c27b1a;stroke-width:2;stroke-dasharray:6 4}"
        ".arrow{stroke:#47586a;stroke-width:1.5;marker-end:url(#tip)}"
    )
    tip = (
        '<marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" '
        'orient="auto"><path d="M0 0L8 4L0 8z" fill="#47586a"/></marker>'
    )
    body, height = "\n".join(parts), LAYERS_TOP + 32 * len(layers()) + 8
    OUT.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        f'width="{WIDTH}" height="{height}"><style>{style}</style><defs>{tip}</defs>'
        f'<rect width="100%" height="100%" fill="#fff"/>\n{body}\n</svg>\n'
    )


if __name__ == "__main__":
    main()
