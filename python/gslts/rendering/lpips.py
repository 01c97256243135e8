"""LPIPS, a perceptual distance of two images from the features of an image classifier.

Source: Zhang et al. 2018, The Unreasonable Effectiveness of Deep Features as a Perceptual Metric,
with AlexNet, version 0.1 of the heads.

The weights are not part of this package. The backbone is torchvision's AlexNet
(`alexnet-owt-7be5be79.pth`), the heads are `lpips/weights/v0.1/alex.pth` of
https://github.com/richzhang/PerceptualSimilarity. This needs PyTorch.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gslts.core.gaussian_map import FloatArray

if TYPE_CHECKING:
    import torch

MAX_BYTES = 1 << 30
"""Maximum size of a file of weights; AlexNet has 233 MiB."""
MIN_SIDE_PX = 31
"""Minimum width and height of an image, px: the pooling layers leave nothing of smaller ones."""
CONVOLUTIONS = (
    # name in torchvision, channels in, channels out, kernel, stride, padding, max pooling before
    ("features.0", 3, 64, 11, 4, 2, False),
    ("features.3", 64, 192, 5, 1, 2, True),
    ("features.6", 192, 384, 3, 1, 1, True),
    ("features.8", 384, 256, 3, 1, 1, False),
    ("features.10", 256, 256, 3, 1, 1, False),
)
"""Convolutions of AlexNet whose outputs LPIPS compares."""
SHIFT, SCALE = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)
"""Normalization of colours from -1 to 1 to the input of AlexNet, from the authors' code."""
EPSILON = 1e-10
"""Added to lengths of features before division, from the authors' code."""


class Lpips:
    """Computes LPIPS with the weights of two files.

    Args:
        backbone: Parameters of torchvision's AlexNet, a PyTorch file with a state dict.
        heads: Linear layers on top of it, `lin0.model.1.weight` to `lin4.model.1.weight`.

    Raises:
        ImportError: PyTorch is not installed.
        OSError: A file cannot be read.
        ValueError: A file is damaged or lacks a tensor; the message names both.
    """

    def __init__(self, backbone: Path, heads: Path) -> None:
        shapes: dict[str, tuple[int, ...]] = {}
        for name, inputs, outputs, kernel, *_ in CONVOLUTIONS:
            shapes[f"{name}.weight"] = (outputs, inputs, kernel, kernel)
            shapes[f"{name}.bias"] = (outputs,)
        self._backbone = _read_weights(backbone, shapes)
        self._heads = _read_weights(
            heads, {_head(k): (1, layer[2], 1, 1) for k, layer in enumerate(CONVOLUTIONS)}
        )

    def distance(self, first: FloatArray, second: FloatArray) -> float:
        """Compute the distance of two images; symmetric, 0 for equal images.

        Args:
            first: [H,W,3] colours, clipped to 0 to 1.
            second: [H,W,3] colours of equal size.

        Raises:
            ValueError: The images are too small, or differ in size.
        """
        import torch

        if first.shape != second.shape or first.ndim != 3 or first.shape[2] != 3:
            raise ValueError(
                f"Lpips: expected two [H,W,3] images of one size, got {first.shape} and "
                f"{second.shape}"
            )
        if min(first.shape[:2]) < MIN_SIDE_PX:
            raise ValueError(
                f"Lpips: images need at least {MIN_SIDE_PX} px a side, got "
                f"{first.shape[1]} x {first.shape[0]}"
            )
        total = 0.0
        with torch.inference_mode():
            layers = zip(self._features(first), self._features(second), strict=True)
            for number, (of_first, of_second) in enumerate(layers):
                difference = (of_first - of_second) ** 2 * self._heads[_head(number)]
                total += float(difference.sum(dim=1).mean())
        return total

    def _features(self, rgb: FloatArray) -> list[torch.Tensor]:
        """Return five layers [1,C,h,w] of features of unit length at each position."""
        import torch
        from torch.nn import functional

        image = torch.from_numpy(2 * rgb.astype(np.float32).clip(0, 1) - 1).permute(2, 0, 1)
        shift, scale = (torch.tensor(values)[:, None, None] for values in (SHIFT, SCALE))
        x = ((image - shift) / scale)[None]
        layers = []
        for name, _, _, _, stride, padding, pooled in CONVOLUTIONS:
            if pooled:
                x = functional.max_pool2d(x, kernel_size=3, stride=2)
            weight, bias = self._backbone[f"{name}.weight"], self._backbone[f"{name}.bias"]
            x = functional.relu(functional.conv2d(x, weight, bias, stride, padding))
            layers.append(x / (x.square().sum(dim=1, keepdim=True).sqrt() + EPSILON))
        return layers


def _head(number: int) -> str:
    return f"lin{number}.model.1.weight"


def _read_weights(path: Path, shapes: dict[str, tuple[int, ...]]) -> dict[str, torch.Tensor]:
    """Read the tensors of given names and shapes as float32; a file may hold more."""
    import torch

    if path.stat().st_size > MAX_BYTES:
        raise ValueError(f"{path}: larger than {MAX_BYTES >> 20} MiB")
    with path.open("rb") as file:
        try:
            content: Any = torch.load(file, map_location="cpu", weights_only=True)
        except Exception as error:  # PyTorch does not document what damaged files raise.
            reason = " ".join(str(error).split())[:120] or type(error).__name__
            raise ValueError(f"{path}: PyTorch cannot read it as weights: {reason}") from None
    if not isinstance(content, dict):
        raise ValueError(f"{path}: expected a state dict, got {type(content).__name__}")
    weights = {}
    for name, shape in shapes.items():
        tensor = content.get(name)
        if not isinstance(tensor, torch.Tensor):
            raise ValueError(f"{path}: there is no tensor {name}")
        if tuple(tensor.shape) != shape:
            raise ValueError(f"{path}: {name}: expected {shape}, got {tuple(tensor.shape)}")
        weights[name] = tensor.detach().to(torch.float32)
        if not bool(torch.isfinite(weights[name]).all()):
            raise ValueError(f"{path}: {name}: holds a number that is not finite")
    return weights
