"""From pictures and what they mean to a map that can be asked: GS-LTS, sec. III-B."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.autoencoder import Autoencoder
from gslts.semantics.lift import FeatureView, lift_features
from gslts.semantics.refine import refine_features
from gslts.semantics.source import SemanticSource
from gslts.semantics.train_autoencoder import train_autoencoder
from gslts.semantics.vocabulary import NOUNS
from gslts.types import Floats32


@dataclass(frozen=True, eq=False)
class SemanticFeatures:
    """What Gaussians mean.

    Attributes:
        features: [N,L*d] codes at each of L levels, one after the other.
        autoencoder: Of the codes.
        names: What the source has words for; nouns of a household if it has none of its own.
    """

    features: Floats32
    autoencoder: Autoencoder
    names: tuple[str, ...]


def embed_semantics(
    gaussian_map: GaussianMap,
    frames: Iterable[RgbdFrame],
    source: SemanticSource,
    code: int = 32,
    refine: int = 0,
    threads: int = 0,
) -> SemanticFeatures:
    """Lifts what frames mean to the Gaussians that they show.

    Args:
        gaussian_map: float32.
        frames: At poses where the map fits them.
        source: Of the meaning.
        code: Length of a code, d.
        refine: Steps of gradient descent after the lifting, as in the paper.
        threads: 0 means one a hardware thread.

    Raises:
        ValueError: There is no frame, one has not what the source needs, or `code` is out of range.
    """
    cameras: list[Camera] = []
    labels: list[NDArray[np.int32]] = []
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
    if not cameras:
        raise ValueError("embedded: frames: there is none")
    seen, row_of = np.unique(np.concatenate(embeddings), axis=0, return_inverse=True)
    autoencoder = train_autoencoder(np.concatenate([seen, source.encode(NOUNS)]), code)
    codes = autoencoder.encode(seen)[row_of.ravel()]
    features = []
    for level in range(len(labels[0])):
        views = _Views(cameras, [of_view[level] for of_view in labels], codes)
        of_level = lift_features(gaussian_map, views, code, threads)
        features.append(refine_features(gaussian_map, of_level, views, refine, threads=threads))
    return SemanticFeatures(
        np.concatenate(features, axis=1), autoencoder, tuple(sorted(names)) or NOUNS
    )


@dataclass(frozen=True, eq=False)
class _Views(Sequence[FeatureView]):
    """Made when they are asked for: all pictures of features would fill the memory."""

    cameras: list[Camera]
    labels: list[NDArray[np.int32]]
    codes: Floats32

    def __len__(self) -> int:
        return len(self.cameras)

    def __getitem__(self, number: Any) -> Any:
        labels = self.labels[number]
        return self.cameras[number], self.codes[labels], labels >= 0
