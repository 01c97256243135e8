"""Tests of images written for people."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gslts.io.images import write_image


def test_an_image_is_written_in_the_format_of_its_suffix(tmp_path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 256, (12, 16, 3)).astype(np.uint8)
    for name, kind in (("view.png", "PNG"), ("view.JPG", "JPEG")):
        write_image(tmp_path / name, image)
        with Image.open(tmp_path / name) as read:
            assert read.format == kind
            assert read.size == (16, 12)
    with Image.open(tmp_path / "view.png") as read:
        np.testing.assert_array_equal(np.asarray(read), image)


@pytest.mark.parametrize("name", ["view", "view.txt", "view.psd"])
def test_a_name_of_no_image_is_an_error(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match=r"expected the name of an image, such as view\.png"):
        write_image(tmp_path / name, np.zeros((4, 4, 3), np.uint8))
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_keeps_the_old_image(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "view.png"
    write_image(path, np.zeros((4, 4, 3), np.uint8))
    old = path.read_bytes()

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", fail)
    with pytest.raises(OSError, match="No space left"):
        write_image(path, np.ones((4, 4, 3), np.uint8))
    assert path.read_bytes() == old
    assert [p.name for p in tmp_path.iterdir()] == ["view.png"]
