"""SAM and its small relatives as pairs of ONNX files: image encoder and mask decoder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gslts.io.onnx_file import MAX_SIDE_PX, find_onnx, first_line, open_onnx
from gslts.semantics.download import download_hint
from gslts.semantics.network_input import (
    IMAGENET_MEAN,
    IMAGENET_STD,
    normalize,
    pad_to_square,
    resize_longest_side,
)
from gslts.semantics.sam import EmbeddedImage, PromptModel
from gslts.semantics.source import MAX_LEVELS
from gslts.types import Bytes, Floats32

SIDE_PX = 1024
"""Side of the images of SAM, px, where an encoder leaves it open."""
PATCH_PX = 16
"""Side of what one embedding shows, px, in all image encoders of SAM."""
LOGITS_SIDE_PX = 256
"""Side of the masks of all of these decoders, px."""
EXAMPLE = "Xenova/slimsam-77-uniform"
"""Public model named in messages; a small SAM."""
LAYOUTS = "input_points (transformers), point_coords (SAM, MobileSAM) or batched_point_coords"
"""Inputs by which layouts are recognized, for messages."""


def open_onnx_sam(folder: Path, threads: int = 1) -> PromptModel:
    """Open a SAM in the layout of its files.

    Args:
        folder: With `*encoder*.onnx` and `*decoder*.onnx`, in it or in its folder `onnx`: of
            transformers.js (SAM, SlimSAM), of the export of SAM's decoder with an encoder beside it
            (SAM, MobileSAM), or of EfficientSAM.
        threads: 0 leaves the choice to onnxruntime.

    Returns:
        The model.

    Raises:
        ImportError: onnxruntime is missing.
        OSError: A file is missing.
        ValueError: A file is damaged, or has other inputs.
    """
    encoder = find_onnx(folder, "*encoder*.onnx", other="decoder")
    decoder = find_onnx(folder, "*decoder*.onnx")
    if encoder is None or decoder is None:
        missing = "*encoder*.onnx" if encoder is None else "*decoder*.onnx"
        raise FileNotFoundError(
            f"{folder}: there is no {missing} of a SAM; {download_hint(folder, EXAMPLE)}"
        )
    sessions = _Session(encoder, threads), _Session(decoder, threads)
    for layout in (_TransformersLayout, _SamLayout, _EfficientSamLayout):
        if layout.POINTS in sessions[1].inputs:
            return layout(*sessions)
    raise ValueError(f"{decoder}: expected an input {LAYOUTS}, got {sorted(sessions[1].inputs)}")


class _Session:
    """An ONNX model whose inputs and outputs have names."""

    def __init__(self, path: Path, threads: int) -> None:
        self.path, self._session = path, open_onnx(path, threads)
        self.inputs = {tensor.name: list(tensor.shape) for tensor in self._session.get_inputs()}
        self.outputs = {tensor.name: list(tensor.shape) for tensor in self._session.get_outputs()}

    def only_input(self, dims: tuple[int, ...]) -> tuple[str, list[Any]]:
        """Return name and shape of the one input, of a number of dimensions."""
        ((name, shape), *others) = self.inputs.items() or [("", [])]
        if others or len(shape) not in dims:
            raise ValueError(f"{self.path}: expected one image as input, got {self.inputs}")
        return name, shape

    def run(self, feed: dict[str, Any], names: tuple[str, ...]) -> list[Any]:
        """Return outputs by name; those that hold floats as float32."""
        if missing := sorted({*names} - self.outputs.keys()):
            raise ValueError(
                f"{self.path}: it has no output {missing[0]}, only {', '.join(self.outputs)}"
            )
        try:
            return list(self._session.run(list(names), feed))
        except Exception as error:
            raise ValueError(f"{self.path}: it does not run: {first_line(error)}") from None


class _PaddedLayout:
    """Image embeddings of SAM: the longer side of the image fills a square, the rest is 0."""

    EMBEDDINGS: tuple[str, ...] = ("image_embeddings",)

    def __init__(self, encoder: _Session, decoder: _Session) -> None:
        self._encoder, self._decoder = encoder, decoder
        self._input, shape = encoder.only_input((3, 4))
        self._takes_bytes = len(shape) == 3  # [H,W,3], 0 to 255: it normalizes and pads itself.
        patches = encoder.outputs.get("image_embeddings", [None])[-1]
        self.side_px = PATCH_PX * patches if isinstance(patches, int) else SIDE_PX
        if not 0 < self.side_px <= MAX_SIDE_PX:
            raise ValueError(
                f"{encoder.path}: expected images of 1..{MAX_SIDE_PX} px, got {self.side_px}"
            )

    def embed(self, rgb: Bytes) -> EmbeddedImage:
        resized = resize_longest_side(rgb, self.side_px)
        if self._takes_bytes:
            pixels = resized.astype(np.float32)
        else:
            normalized = normalize(resized, IMAGENET_MEAN, IMAGENET_STD)
            pixels = pad_to_square(normalized, self.side_px)
        values = self._encoder.run({self._input: pixels}, self.EMBEDDINGS)
        return EmbeddedImage(values, (resized.shape[0], resized.shape[1]))


class _TransformersLayout(_PaddedLayout):
    """Export of transformers, as transformers.js takes it."""

    POINTS = "input_points"
    EMBEDDINGS = ("image_embeddings", "image_positional_embeddings")

    def decode(self, image: EmbeddedImage, points: Floats32) -> tuple[Floats32, Floats32]:
        feed = {
            self.POINTS: points[None, :, None],
            "input_labels": np.ones((1, len(points), 1), np.int64),
            **dict(zip(self.EMBEDDINGS, image.values, strict=True)),
        }
        logits, ious = self._decoder.run(feed, ("pred_masks", "iou_scores"))
        return _checked(self._decoder, logits[0], ious[0])


class _SamLayout(_PaddedLayout):
    """Export of the decoder by SAM itself; it takes one prompt at a time."""

    POINTS = "point_coords"

    def decode(self, image: EmbeddedImage, points: Floats32) -> tuple[Floats32, Floats32]:
        decoded = [self._decode_point(image, point) for point in points]
        logits, ious = (np.concatenate(parts) for parts in zip(*decoded, strict=True))
        # The first of four masks is for prompts of several points.
        return _checked(self._decoder, logits[:, -MAX_LEVELS:], ious[:, -MAX_LEVELS:])

    def _decode_point(self, image: EmbeddedImage, point: Floats32) -> list[Any]:
        side = LOGITS_SIDE_PX
        feed = {
            "image_embeddings": image.values[0],
            # Without a box, a second point with the label -1 stands for its absence.
            self.POINTS: np.array([[point, (0, 0)]], np.float32),
            "point_labels": np.array([[1, -1]], np.float32),
            "mask_input": np.zeros((1, 1, side, side), np.float32),
            "has_mask_input": np.zeros(1, np.float32),
            "orig_im_size": np.array([side, side], np.float32),
        }
        return self._decoder.run(feed, ("low_res_masks", "iou_predictions"))


class _EfficientSamLayout:
    """Export of EfficientSAM (Xiong et al. 2024), which stretches images to a square itself."""

    POINTS = "batched_point_coords"

    def __init__(self, encoder: _Session, decoder: _Session) -> None:
        self._encoder, self._decoder = encoder, decoder
        self._input, _ = encoder.only_input((4,))
        self.side_px = SIDE_PX

    def embed(self, rgb: Bytes) -> EmbeddedImage:
        pixels = np.ascontiguousarray(rgb.transpose(2, 0, 1)[None].astype(np.float32) / 255)
        values = self._encoder.run({self._input: pixels}, ("image_embeddings",))
        return EmbeddedImage(values[0], (self.side_px, self.side_px))

    def decode(self, image: EmbeddedImage, points: Floats32) -> tuple[Floats32, Floats32]:
        side = LOGITS_SIDE_PX
        feed = {
            "image_embeddings": image.values,
            self.POINTS: points[None, :, None] * np.float32(side / self.side_px),
            "batched_point_labels": np.ones((1, len(points), 1), np.float32),
            "orig_im_size": np.array([side, side], np.int64),
        }
        logits, ious = self._decoder.run(feed, ("output_masks", "iou_predictions"))
        logits, ious = _checked(self._decoder, logits[0], ious[0])
        # Some versions put the best mask first; levels go by area.
        order = np.argsort((logits > 0).sum(axis=(2, 3)), axis=1, kind="stable")
        return (
            np.take_along_axis(logits, order[..., None, None], axis=1),
            np.take_along_axis(ious, order, axis=1),
        )


def _checked(decoder: _Session, logits: Any, ious: Any) -> tuple[Floats32, Floats32]:
    if logits.ndim != 4 or ious.shape != logits.shape[:2] or ious.shape[1] != MAX_LEVELS:
        raise ValueError(
            f"{decoder.path}: expected {MAX_LEVELS} masks per point, got {logits.shape} with "
            f"scores {ious.shape}; export the decoder without --return-single-mask"
        )
    return np.asarray(logits, np.float32), np.asarray(ious, np.float32)
