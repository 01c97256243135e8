"""Checks of drawn figures."""

from pathlib import Path

from PIL import Image


def assert_drawn(path: Path) -> None:
    """Fail unless an image is large enough to be read and has many colours."""
    with Image.open(path) as image:
        assert min(image.size) >= 100
        assert len(image.convert("RGB").getcolors(1 << 24)) > 50
