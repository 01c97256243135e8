"""Pictures that programs draw."""

from pathlib import Path

from PIL import Image


def assert_drawn(path: Path) -> None:
    """Fail unless a picture is large enough to be read and has many colours."""
    with Image.open(path) as picture:
        assert min(picture.size) >= 100
        assert len(picture.convert("RGB").getcolors(1 << 24)) > 50
