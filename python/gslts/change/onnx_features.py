"""Features from an image encoder in an ONNX file, such as that of EfficientSAM."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gslts.change.constants import MAX_MODEL_SIDE_PX
from gslts.types import Floats32

DEFAULT_SIDE_PX = 1024
"""Side of the input image where the model leaves it open, px: that of EfficientSAM (Xiong et al.
2024), which normalizes colours itself."""
MAX_FILE_BYTES = 1 << 31
"""Maximum size of the file, 2 GiB; bounds the memory that a wrong file takes."""


class OnnxEncoder:
    """Runs an encoder on the CPU, from [1,3,S,S] float32, 0 to 1, to [1,D,h,w].

    Args:
        path: ONNX file, such as `efficient_sam_vitt_encoder.onnx` of EfficientSAM.
        threads: Number of threads; 0 leaves the choice to onnxruntime.

    Raises:
        ImportError: onnxruntime is missing.
        OSError: The file cannot be read.
        ValueError: The file is no encoder of images.
    """

    def __init__(self, path: Path, threads: int = 1) -> None:
        try:
            import onnxruntime
        except ImportError:
            raise ImportError("onnx features need onnxruntime: pip install 'gslts[onnx]'") from None
        if path.stat().st_size > MAX_FILE_BYTES:
            raise ValueError(f"{path}: it is larger than {MAX_FILE_BYTES >> 30} GiB")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        content = path.read_bytes()
        try:
            self._session: Any = onnxruntime.InferenceSession(
                content, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # onnxruntime has no public base class for its errors.
            raise ValueError(f"{path}: it is no ONNX model: {error}") from None
        self._path = path
        self._input, self._size = self._check_input()

    def __call__(self, rgb: Floats32) -> Floats32:
        """Compute [h,w,D] features; see `FeatureExtractor`.

        Args:
            rgb: [H,W,3] sRGB, 0 to 1; resized to the input of the model.

        Raises:
            ValueError: The model fails, or its output is no feature image.
        """
        image = cv2.resize(rgb, self._size, interpolation=cv2.INTER_LINEAR)
        feed = {self._input: np.ascontiguousarray(image.transpose(2, 0, 1)[None])}
        try:
            output = self._session.run(None, feed)[0]
        except Exception as error:
            raise ValueError(f"{self._path}: it does not take an image: {error}") from None
        if output.ndim != 4 or output.shape[0] != 1:
            raise ValueError(f"{self._path}: expected features [1,D,h,w], got {output.shape}")
        return np.ascontiguousarray(output[0].transpose(1, 2, 0), np.float32)

    def _check_input(self) -> tuple[str, tuple[int, int]]:
        """Check the shapes of the model; return name, and width and height, px, of its input."""
        path = self._path
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        shape = list(inputs[0].shape) if inputs else []
        # A side that is left open has a name, or None.
        channels = shape[1] if len(shape) == 4 else 0
        if len(inputs) != 1 or (isinstance(channels, int) and channels != 3):
            shapes = ", ".join(str(tensor.shape) for tensor in inputs)
            raise ValueError(f"{path}: expected one input [1,3,H,W], got {shapes or 'none'}")
        if inputs[0].type != "tensor(float)":
            raise ValueError(f"{path}: expected an input of float32, got {inputs[0].type}")
        if any(isinstance(side, int) and not 0 < side <= MAX_MODEL_SIDE_PX for side in shape[2:]):
            raise ValueError(f"{path}: images of {shape} are larger than {MAX_MODEL_SIDE_PX} px")
        if len(outputs[0].shape) not in (0, 4):  # No shape is given where the model leaves it open.
            raise ValueError(f"{path}: expected features [1,D,h,w], got {outputs[0].shape}")
        height, width = (side if isinstance(side, int) else DEFAULT_SIDE_PX for side in shape[2:])
        return inputs[0].name, (width, height)
