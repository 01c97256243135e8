"""Semantic source of SAM masks and their CLIP embeddings (GS-LTS, sec. III-A)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol, Self

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.io.onnx_file import find_onnx
from gslts.semantics.clip_onnx import EXAMPLE as CLIP_EXAMPLE
from gslts.semantics.clip_onnx import OnnxClip
from gslts.semantics.download import require_folder
from gslts.semantics.masks import crop_to_mask, paint_labels
from gslts.semantics.sam import MaskGenerator, PromptModel
from gslts.semantics.sam_onnx import EXAMPLE as SAM_EXAMPLE
from gslts.semantics.sam_onnx import open_onnx_sam
from gslts.semantics.source import MAX_LEVELS, Segments, relevance
from gslts.semantics.vocabulary import UNRELATED
from gslts.types import Bools, Bytes, Floats32


class Encoder(Protocol):
    """Embeds images and texts in one space, as CLIP does.

    Attributes:
        dims: Length of an embedding, D.
        side_px: Side of the square images that it takes.
    """

    dims: int
    side_px: int

    def encode_images(self, images: Sequence[Bytes]) -> Floats32:
        """Embed images.

        Args:
            images: S images [side_px,side_px,3] uint8, sRGB.

        Returns:
            [S,D] float32, of unit length.
        """
        ...

    def encode_texts(self, texts: Sequence[str]) -> Floats32:
        """Embed texts.

        Args:
            texts: T texts.

        Returns:
            [T,D] float32, of unit length.
        """
        ...


class ClipSource:
    """Segments frames with SAM and embeds segments and texts with CLIP: the variant CLIP of GS-LTS.

    Args:
        encoder: Embeds images and texts.
        generator: Computes the masks [K,H,W] of an image at each of `MAX_LEVELS` levels; None if
            only texts are embedded.
    """

    names = ()
    codec = None
    """An autoencoder is trained on the embeddings."""
    relevance = staticmethod(relevance)
    threshold = 0.5
    """Relevance of a query that matches as well as the canonical phrases (LERF, Kerr et al. 2023).
    Cosines of CLIP differ by a few hundredths, so that relevance stays near this value, and how
    much more is a match depends on the weights and the map."""
    unrelated: tuple[str, ...] = UNRELATED

    def __init__(
        self,
        encoder: Encoder,
        generator: Callable[[Bytes], list[Bools]] | None = None,
    ) -> None:
        self._encoder, self._generator = encoder, generator

    @classmethod
    def from_folders(cls, clip: Path, sam: Path | None = None, threads: int = 0) -> Self:
        """Open the models: by onnxruntime where a folder has ONNX files, else by transformers.

        Args:
            clip: Folder of CLIP; see `OnnxClip` and `ClipEncoder`.
            sam: Folder of SAM; see `open_onnx_sam` and `TransformersSam`. None if only texts are
                embedded.
            threads: 0 uses the default of onnxruntime and torch.

        Returns:
            The source.

        Raises:
            ImportError: A package is missing.
            OSError: A file is missing; the message says how to get it.
            ValueError: A file is damaged, or belongs to another model.
        """
        encoder = _open_clip(clip, threads)
        return cls(encoder, None if sam is None else MaskGenerator(_open_sam(sam, threads)))

    @property
    def dims(self) -> int:
        """Length of an embedding, D."""
        return self._encoder.dims

    def segments(self, frame: RgbdFrame) -> Segments:
        """Return three levels of masks with embeddings; hidden masks are left out.

        Args:
            frame: Its colours are segmented, within its mask if it has one.

        Returns:
            Masks and embeddings.

        Raises:
            ValueError: The source has no mask generator.
        """
        if self._generator is None:
            raise ValueError("ClipSource: it has no SAM to segment frames with, only CLIP")
        labels = np.full((MAX_LEVELS, *frame.rgb.shape[:2]), -1, np.int32)
        crops: list[Bytes] = []
        for level, generated in enumerate(self._generator(frame.rgb)):
            masks = generated if frame.mask is None else generated & frame.mask
            rows, pixel_rows = np.unique(paint_labels(masks), return_inverse=True)
            visible = rows[rows >= 0]
            # Row -1, if present, is the first one.
            numbers = np.arange(len(rows)) - (len(rows) - len(visible)) + len(crops)
            labels[level] = np.where(rows < 0, -1, numbers)[pixel_rows]
            crops += [crop_to_mask(frame.rgb, masks[row], self._encoder.side_px) for row in visible]
        return Segments(labels, self._encoder.encode_images(crops))

    def encode(self, texts: Sequence[str]) -> Floats32:
        """Embed texts.

        Args:
            texts: Such as names of objects.

        Returns:
            [T,D] float32, of unit length.
        """
        return self._encoder.encode_texts(texts)

    def explain(self, text: str) -> str:  # noqa: ARG002
        """Explain nothing: CLIP understands any text.

        Args:
            text: Not used.
        """
        return ""


def _open_clip(folder: Path, threads: int) -> Encoder:
    require_folder(folder, CLIP_EXAMPLE)
    if find_onnx(folder, "*.onnx"):
        return OnnxClip(folder, threads)
    from gslts.semantics.clip import ClipEncoder

    return ClipEncoder(folder, threads)


def _open_sam(folder: Path, threads: int) -> PromptModel:
    require_folder(folder, SAM_EXAMPLE)
    if find_onnx(folder, "*.onnx"):
        return open_onnx_sam(folder, threads)
    from gslts.semantics.sam_transformers import TransformersSam

    return TransformersSam(folder, threads)
