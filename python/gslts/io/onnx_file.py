"""ONNX files, run on the CPU by onnxruntime."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gslts.io.messages import to_line

MAX_FILE_BYTES = 2_000_000_000
"""Size from which a file is rejected; bounds the memory that a wrong file takes. CLIP ViT-L/14 has
1.2 GB, and ONNX itself allows no file above 2 GiB."""
MAX_SIDE_PX = 4096
"""Maximum side of the input image of a model, px; bounds the memory of a damaged or hostile one."""


def open_onnx(path: Path, threads: int = 1) -> Any:
    """Open an ONNX model. Weights in other files must be in its folder.

    Args:
        path: ONNX file.
        threads: Number of threads; 0 leaves the choice to onnxruntime.

    Returns:
        The `InferenceSession` of onnxruntime.

    Raises:
        ImportError: onnxruntime is missing.
        OSError: The file cannot be read.
        ValueError: The file is too large, or is no ONNX model.
    """
    try:
        import onnxruntime
    except ImportError:
        raise ImportError("ONNX models need onnxruntime: pip install 'gslts[onnx]'") from None
    check_size(path)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 4  # Errors are exceptions; warnings are of no use to users.
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime has no public base class for its errors.
        raise ValueError(f"{path}: it is no ONNX model: {first_line(error)}") from None


def find_onnx(folder: Path, pattern: str, other: str = "") -> Path | None:
    """Find an ONNX file in a folder, or in the folder `onnx` in it.

    Args:
        folder: As of `hf download`.
        pattern: Of its name, such as "text_model*.onnx". Of several precisions, the shortest name
            is that of float32; files that are too large come last.
        other: Part of a name that other files have; empty for none.

    Returns:
        The file; None if there is none.
    """
    found = [*folder.glob(pattern), *folder.glob(f"onnx/{pattern}")]
    fitting = [path for path in found if not other or other not in path.name]

    def rank(path: Path) -> tuple[bool, int, str]:
        return path.stat().st_size >= MAX_FILE_BYTES, len(path.name), path.name

    return min(fitting, key=rank, default=None)


def image_input(session: Any, path: Path, default_side_px: int) -> tuple[str, tuple[int, int]]:
    """Check that a model takes one image [1,3,H,W] float32.

    Args:
        session: Of `open_onnx`.
        path: Its file, for messages.
        default_side_px: Side where the model leaves it open, px.

    Returns:
        Name, and width and height, px, of the input.

    Raises:
        ValueError: The model takes anything else.
    """
    inputs = session.get_inputs()
    shape = list(inputs[0].shape) if inputs else []
    # A side that is left open has a name, or None.
    channels = shape[1] if len(shape) == 4 else 0
    if len(inputs) != 1 or (isinstance(channels, int) and channels != 3):
        shapes = ", ".join(str(tensor.shape) for tensor in inputs)
        raise ValueError(f"{path}: expected one input [1,3,H,W], got {shapes or 'none'}")
    if inputs[0].type != "tensor(float)":
        raise ValueError(f"{path}: expected an input of float32, got {inputs[0].type}")
    if any(isinstance(side, int) and not 0 < side <= MAX_SIDE_PX for side in shape[2:]):
        raise ValueError(f"{path}: images of {shape} are larger than {MAX_SIDE_PX} px")
    height, width = (side if isinstance(side, int) else default_side_px for side in shape[2:])
    return inputs[0].name, (width, height)


def check_size(path: Path) -> None:
    """Reject a file of weights that is missing, a folder or too large, before it is read.

    Args:
        path: The file.

    Raises:
        OSError: It is no file.
        ValueError: It has `MAX_FILE_BYTES` or more.
    """
    if path.is_dir():
        raise IsADirectoryError(f"{path}: it is a folder; expected a file of weights")
    if path.stat().st_size >= MAX_FILE_BYTES:
        raise ValueError(f"{path}: it has {MAX_FILE_BYTES / 1e9:g} GB or more")


def first_line(error: Exception) -> str:
    """Return the beginning of the message of another library, in one line.

    Args:
        error: Its exception.
    """
    return to_line(str(error))[:300]
