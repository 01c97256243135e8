"""Files of ONNX models: their sizes, and the choice among several precisions."""

from pathlib import Path

import pytest

from gslts.io.onnx_file import check_size, find_onnx

VIT_L_BYTES = 1_215_864_832
"""Size of the image encoder of CLIP ViT-L/14 in float32."""


def write_sparse(path: Path, size: int) -> None:
    """Write a file that takes no space."""
    path.parent.mkdir(exist_ok=True)
    with path.open("wb") as file:
        file.truncate(size)


def test_a_large_clip_is_read_and_larger_files_are_rejected(tmp_path: Path) -> None:
    write_sparse(tmp_path / "vision_model.onnx", VIT_L_BYTES)
    check_size(tmp_path / "vision_model.onnx")
    write_sparse(tmp_path / "vision_model.onnx", 2_000_000_000)
    with pytest.raises(ValueError, match=r"vision_model\.onnx: it has 2 GB or more$"):
        check_size(tmp_path / "vision_model.onnx")


def test_of_several_precisions_the_shortest_name_that_is_not_too_large_is_found(
    tmp_path: Path,
) -> None:
    names = ("vision_model.onnx", "vision_model_fp16.onnx", "vision_model_quantized.onnx")
    for name in names:
        write_sparse(tmp_path / "onnx" / name, 1_000)
    pattern = "vision_model*.onnx"
    assert find_onnx(tmp_path, pattern) == tmp_path / "onnx" / names[0]
    write_sparse(tmp_path / "onnx" / names[0], 2_000_000_000)
    assert find_onnx(tmp_path, pattern) == tmp_path / "onnx" / names[1]
    for name in names[1:]:
        (tmp_path / "onnx" / name).unlink()
    assert find_onnx(tmp_path, pattern) == tmp_path / "onnx" / names[0]
    assert find_onnx(tmp_path, "text_model*.onnx") is None
