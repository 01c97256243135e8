"""Tests of image files against Pillow: sizes, pixels, damage and limits."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from gslts.io import image_files
from gslts.io.image_files import (
    decode_integers,
    decode_rgb,
    encode_jpeg,
    encode_png,
    image_size,
    read_integers,
    read_rgb,
    shrink_image,
    write_image,
)


def noise(shape: tuple[int, ...], dtype: Any = np.uint8) -> Any:
    """Return random pixels."""
    top = np.iinfo(dtype).max
    return np.random.default_rng(0).integers(0, top, shape, endpoint=True).astype(dtype)


def encoded(image: Image.Image, kind: str, **options: Any) -> bytes:
    """Return a file of Pillow."""
    file = io.BytesIO()
    image.save(file, kind, **options)
    return file.getvalue()


def netpbm(pixels: Any, max_value: int) -> bytes:
    """Return a grey or colour image."""
    kind = "P5" if pixels.ndim == 2 else "P6"
    head = f"{kind}\n# of a test\n{pixels.shape[1]} {pixels.shape[0]} # px\n{max_value}\n"
    return head.encode() + pixels.astype(np.uint8 if max_value < 256 else ">u2").tobytes()


@pytest.mark.parametrize("suffix", ["jpg", "png", "tiff", "bmp", "webp", "ppm"])
def test_pixels_are_those_of_pillow(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"image.{suffix}"
    Image.fromarray(noise((30, 50, 3))).save(path)
    assert image_size(path) == (50, 30)
    with Image.open(path) as expected:
        # The conversion of WebP from YUV rounds in another way.
        assert np.abs(read_rgb(path, (30, 50)) - np.asarray(expected, int)).max() <= (
            2 if suffix == "webp" else 0
        )


@pytest.mark.parametrize("mode", ["L", "P", "RGBA", "LA", "1"])
def test_other_pixels_become_colours(mode: str) -> None:
    image = Image.fromarray(noise((6, 8, 3))).convert(mode)
    expected = np.asarray(image.convert("RGB"))
    np.testing.assert_array_equal(decode_rgb(encoded(image, "PNG")), expected)


def test_sixteen_bits_become_eight() -> None:
    pixels = noise((6, 8), np.uint16)
    rgb = decode_rgb(encode_png(pixels))
    assert np.abs(rgb[..., 0] - pixels / 257).max() <= 1


@pytest.mark.parametrize("max_value", [15, 255, 1023, 65535])
def test_netpbm_of_any_maximum(max_value: int) -> None:
    for shape in ((6, 8), (6, 8, 3)):
        pixels = np.random.default_rng(0).integers(0, max_value, shape, endpoint=True)
        content = netpbm(pixels, max_value)
        if max_value in (255, 65535):
            colours = np.broadcast_to(pixels.reshape(6, 8, -1), (6, 8, 3))
            assert np.abs(decode_rgb(content) - colours * (255 / max_value)).max() <= 1
        else:
            with pytest.raises(ValueError, match=f"white is {max_value}, expected 255 or 65535"):
                decode_rgb(content)
    result = decode_integers(netpbm(pixels[..., 0], max_value))
    assert result.dtype == (np.uint8 if max_value < 256 else np.uint16)
    np.testing.assert_array_equal(result, pixels[..., 0])


@pytest.mark.parametrize("kind", ["TIFF", "PPM"])
def test_kinds_that_few_programs_write(kind: str) -> None:
    """Read a BigTIFF, and a bitmap."""
    pixels = noise((6, 8)) > 127
    if kind == "PPM":
        content = encoded(Image.fromarray(pixels), "PPM")
        assert content.startswith(b"P4")
    else:
        content = encoded(Image.fromarray(255 * pixels.astype(np.uint8)), kind, big_tiff=True)
        assert content.startswith(b"II+\0")
    np.testing.assert_array_equal(decode_rgb(content), np.repeat(255 * pixels[..., None], 3, 2))


def test_a_long_header_is_not_read() -> None:
    content = b"P6" + b" " * 5000 + b"8 6 255\n" + bytes(144)
    with pytest.raises(ValueError, match="not an image"):
        decode_rgb(content)


def test_images_are_not_turned(tmp_path: Path) -> None:
    image = Image.fromarray(noise((6, 8, 3)))
    exif = image.getexif()
    exif[0x0112] = 6  # Orientation: turn it by 90 degrees.
    path = tmp_path / "turned.png"
    image.save(path, exif=exif)
    assert image_size(path) == (8, 6)
    np.testing.assert_array_equal(read_rgb(path, (6, 8)), np.asarray(image))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("kind", ["PNG", "TIFF"])
def test_integers_are_exact(tmp_path: Path, dtype: Any, kind: str) -> None:
    pixels = noise((6, 8), dtype)
    path = tmp_path / "depth"
    path.write_bytes(encoded(Image.fromarray(pixels), kind))
    result = read_integers(path, (6, 8))
    assert result.dtype == dtype
    np.testing.assert_array_equal(result, pixels)


@pytest.mark.parametrize(
    ("pixels", "kind", "message"),
    [
        (np.zeros((6, 8, 3), np.uint8), "PNG", "3 uint8 per pixel, expected one integer"),
        (np.zeros((6, 8), np.float32), "TIFF", "1 float32 per pixel, expected one integer"),
    ],
)
def test_other_pixels_are_no_integers(pixels: Any, kind: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        decode_integers(encoded(Image.fromarray(pixels), kind))


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "TIFF", "BMP", "WEBP", "PPM"])
def test_cut_images_are_damaged(tmp_path: Path, kind: str) -> None:
    content = encoded(Image.fromarray(noise((30, 50, 3))), kind)
    for size in (*range(0, len(content) - 1, 97), len(content) - 20):
        path = tmp_path / "cut"
        path.write_bytes(content[:size])
        with pytest.raises(ValueError, match=r"cut: (the image is damaged|not an image)"):
            read_rgb(path, (30, 50))


def test_damaged_offsets_are_errors() -> None:
    content = bytearray(encoded(Image.new("P", (8, 8)), "TIFF"))
    content[72] = 7  # Makes offsets bytes.
    with pytest.raises(
        ValueError, match=r"^the image is damaged, or of a kind that OpenCV does not read$"
    ):
        decode_rgb(bytes(content))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"no image",
        b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 8 6\n%%EndComments\n",
        b'<svg width="8" height="6"></svg>',
        b"GIF89a" + bytes(20),
        b"P6 8",
        b"RIFF" + bytes(40),
        b"\xff\xd8\xff",
    ],
)
def test_other_files_are_no_images(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "image.png"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"image\.png: not an image in JPEG, PNG, .* or PPM$"):
        image_size(path)


def test_large_files_are_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(image_files, "MAX_FILE_BYTES", 1000)
    path = tmp_path / "image.png"
    write_image(path, noise((30, 50, 3)))
    with pytest.raises(ValueError, match=r"image\.png: larger than 1,000 bytes"):
        read_rgb(path, (30, 50))


def test_encoded_images_are_read_by_pillow() -> None:
    rgb, depth = noise((30, 50, 3)), noise((30, 50), np.uint16)
    for pixels in (rgb, depth, rgb[::2, ::-1]):
        with Image.open(io.BytesIO(encode_png(pixels))) as read:
            np.testing.assert_array_equal(np.asarray(read), pixels)
    plain = np.full((32, 32, 3), (200, 100, 50), np.uint8)
    with Image.open(io.BytesIO(encode_jpeg(plain, 90))) as read:
        assert read.format == "JPEG"
        assert np.abs(np.asarray(read, int) - plain).max() < 4


def test_shrinking_averages_and_keeps_the_aspect_ratio() -> None:
    image = noise((60, 80, 3))
    small = shrink_image(image, (40, 100))
    means = image.reshape(30, 2, 40, 2, 3).mean(axis=(1, 3))
    assert np.abs(small - means).max() <= 1
    assert shrink_image(image, (100, 15)).shape == (15, 20, 3)
    assert shrink_image(image, (80, 60)) is image


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
