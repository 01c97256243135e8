"""Features from an image encoder in an ONNX file, such as that of EfficientSAM."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from gslts.io.onnx_file import image_input, open_onnx
from gslts.types import Floats32

DEFAULT_SIDE_PX = 1024
"""Side of the input image where the model leaves it open, px: that of EfficientSAM (Xiong et al.
2024), which normalizes colours itself."""


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
        self._path, self._session = path, open_onnx(path, threads)
        self._input, self._size = image_input(self._session, path, DEFAULT_SIDE_PX)
        shape = self._session.get_outputs()[0].shape
        if len(shape) not in (0, 4):  # No shape is given where the model leaves it open.
            raise ValueError(f"{path}: expected features [1,D,h,w], got {shape}")

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
