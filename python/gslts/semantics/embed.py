"""Semantic features for the Gaussians of a map from RGB-D frames (GS-LTS, sec. III-A)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.autoencoder import CODE_DIMS
from gslts.semantics.lift import FeatureView, lift_codes, lift_features
from gslts.semantics.refine import refine_features
from gslts.semantics.source import Codec, SemanticSource
from gslts.semantics.vocabulary import NOUNS
from gslts.types import Floats32, Ints32


@dataclass(frozen=True, eq=False)
class SemanticFeatures:
    """Semantic features of a map and the codec that decodes them.

    Attributes:
        features: [N,L*d] float32, for each Gaussian a code of d numbers at each of L levels.
        codec: Decodes the codes to embeddings.
        names: Names of the object types in the frames, or of all classes of a detector; household
            nouns if the source has no names.
    """

    features: Floats32
    codec: Codec
    names: tuple[str, ...]


def embed_semantics(
    gaussian_map: GaussianMap,
    frames: Iterable[RgbdFrame],
    source: SemanticSource,
    code_dims: int = CODE_DIMS,
    refine: int = 0,
    threads: int = 0,
) -> SemanticFeatures:
    """Compute semantic features for all Gaussians of a map.

    Segments each frame, compresses the embeddings of the segments with an autoencoder trained on
    them, unless the source has a codec, and lifts the codes to the Gaussians in closed form.

    Args:
        gaussian_map: float32; its features are not used.
        frames: With the camera poses at which the map was optimized.
        source: Segments the frames.
        code_dims: Length of a code, d, of an autoencoder.
        refine: Number of gradient steps after lifting codes of an autoencoder, as in GS-LTS; 0 for
            none.
        threads: 0 uses one per hardware thread; does not change results.

    Returns:
        The features, the codec and the names.

    Raises:
        ValueError: There is no frame or no segment, the source cannot segment a frame, or
            `code_dims` is out of range.
    """
    if source.codec is not None:
        return _embed_classes(gaussian_map, frames, source, source.codec, threads)
    from gslts.semantics.train_autoencoder import train_autoencoder

    cameras, labels, embeddings, names = _segment_frames(frames, source)
    if not cameras:
        raise ValueError("embed_semantics: frames: expected at least one, got none")
    if not any(map(len, embeddings)):
        raise ValueError("embed_semantics: frames: none has a segment")
    distinct, row_of = np.unique(np.concatenate(embeddings), axis=0, return_inverse=True)
    codec = train_autoencoder(np.concatenate([distinct, source.encode(NOUNS)]), code_dims)
    codes = codec.encode(distinct)[row_of.ravel()]
    features = []
    for level in range(len(labels[0])):
        views = _FeatureViews(cameras, [frame_labels[level] for frame_labels in labels], codes)
        lifted = lift_features(gaussian_map, views, code_dims, threads)
        features.append(refine_features(gaussian_map, lifted, views, refine, threads=threads))
    return SemanticFeatures(np.concatenate(features, axis=1), codec, tuple(sorted(names)) or NOUNS)


def _embed_classes(
    gaussian_map: GaussianMap,
    frames: Iterable[RgbdFrame],
    source: SemanticSource,
    codec: Codec,
    threads: int,
) -> SemanticFeatures:
    """Lift the segments of one frame after the other; a fixed codec needs no training."""

    def views() -> Iterator[FeatureView]:
        for frame in frames:
            segments = source.segments(frame)
            yield frame.camera, segments.labels[0], codec.encode(segments.embeddings)

    features = lift_codes(gaussian_map, views(), codec, threads)
    return SemanticFeatures(features, codec, source.names)


def _segment_frames(
    frames: Iterable[RgbdFrame], source: SemanticSource
) -> tuple[list[Camera], list[Ints32], list[Floats32], set[str]]:
    """Segment frames; labels are rows of the concatenated embeddings."""
    cameras: list[Camera] = []
    labels: list[Ints32] = []
    embeddings: list[Floats32] = []
    names: set[str] = set()
    rows = 0
    for frame in frames:
        segments = source.segments(frame)
        known = segments.labels >= 0
        cameras.append(frame.camera)
        labels.append(np.where(known, segments.labels + rows, -1).astype(np.int32))
        embeddings.append(segments.embeddings)
        names.update(segments.names)
        rows += len(segments.embeddings)
    return cameras, labels, embeddings, names


@dataclass(frozen=True, eq=False)
class _FeatureViews(Sequence[FeatureView]):
    """Labels and codes of one level."""

    cameras: list[Camera]
    labels: list[Ints32]
    codes: Floats32

    def __len__(self) -> int:
        return len(self.cameras)

    def __getitem__(self, number: Any) -> Any:
        return self.cameras[number], self.labels[number], self.codes
