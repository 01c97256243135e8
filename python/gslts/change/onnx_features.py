"""Features by an image encoder in an ONNX file, such as EfficientSAM's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gslts.types import Floats32

SIDE_PX = 1024
"""Of the images of EfficientSAM (Xiong et al. 2024), which takes the mean off itself; for encoders
that leave the sides open."""
MOST_SIDE_PX = 4096
MOST_BYTES = 1 << 31
"""Larger files are no encoder for a robot."""


class OnnxEncoder:
    """Runs an encoder on the CPU: [1,3,S,S] float32, 0 to 1, to [1,D,h,w].

    Args:
        path: The file; EfficientSAM publishes `efficient_sam_vitt_encoder.onnx`.
        threads: 0 means as many as onnxruntime wants.

    Raises:
        ImportError: onnxruntime is missing.
        OSError: The file cannot be read.
        ValueError: It is no encoder of images.
    """

    def __init__(self, path: Path, threads: int = 1) -> None:
        try:
            import onnxruntime
        except ImportError:
            raise ImportError("onnx features need onnxruntime: pip install 'gslts[onnx]'") from None
        if path.stat().st_size > MOST_BYTES:
            raise ValueError(f"{path}: it is larger than {MOST_BYTES >> 30} GiB")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        content = path.read_bytes()
        try:
            self._session: Any = onnxruntime.InferenceSession(
                content, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # onnxruntime has no public base class for what it raises.
            raise ValueError(f"{path}: it is no ONNX model: {error}") from None
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        shape = list(inputs[0].shape) if inputs else []
        # A side that is left open has a name, or None.
        channels = shape[1] if len(shape) == 4 else 0
        if len(inputs) != 1 or (isinstance(channels, int) and channels != 3):
            shapes = ", ".join(str(one.shape) for one in inputs)
            raise ValueError(f"{path}: expected one input [1,3,H,W], got {shapes or 'none'}")
        if inputs[0].type != "tensor(float)":
            raise ValueError(f"{path}: expected an input of float32, got {inputs[0].type}")
        if any(isinstance(side, int) and not 0 < side <= MOST_SIDE_PX for side in shape[2:]):
            raise ValueError(f"{path}: images of {shape} are larger than {MOST_SIDE_PX} px")
        if len(outputs[0].shape) not in (0, 4):  # None is named where the model does not tell.
            raise ValueError(f"{path}: expected features [1,D,h,w], got {outputs[0].shape}")
        height, width = shape[2:]
        self._name = inputs[0].name
        self._size = (
            width if isinstance(width, int) else SIDE_PX,
            height if isinstance(height, int) else SIDE_PX,
        )
        self._path = path

    def __call__(self, rgb: Floats32) -> Floats32:
        """[h,w,D]; see `FeatureExtractor`."""
        image = cv2.resize(rgb, self._size, interpolation=cv2.INTER_LINEAR)
        feed = {self._name: np.ascontiguousarray(image.transpose(2, 0, 1)[None])}
        try:
            output = self._session.run(None, feed)[0]
        except Exception as error:
            raise ValueError(f"{self._path}: it does not take an image: {error}") from None
        if output.ndim != 4 or output.shape[0] != 1:
            raise ValueError(f"{self._path}: expected features [1,D,h,w], got {output.shape}")
        return np.ascontiguousarray(output[0].transpose(1, 2, 0), np.float32)
