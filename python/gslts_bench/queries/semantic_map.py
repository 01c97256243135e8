"""Maps of homes with semantic features, computed from the simulator's labels and cached."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import open_dataset
from gslts.io.atomic_files import write_atomic
from gslts.semantics.autoencoder import Autoencoder, autoencoder_bytes, read_autoencoder
from gslts.semantics.embed import embed_semantics
from gslts.semantics.source import Oracle
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import read_map
from gslts_bench.cache import cached_folder, code_digest, native_digest
from gslts_bench.homes import BenchHome

CODE = 32
"""Length of a Gaussian's semantic feature, the product's default."""


@dataclass(frozen=True, eq=False)
class SemanticMap:
    """A map whose Gaussians have semantic features.

    Attributes:
        gaussian_map: Map with features.
        codec: Decodes the features.
    """

    gaussian_map: GaussianMap
    codec: Autoencoder


def mapped_frames(bench: BenchHome) -> Iterator[RgbdFrame]:
    """Read the frames that the map of a home was made from, with the poses that mapping found.

    Args:
        bench: The home.
    """
    cameras = cameras_of_map(bench.map())
    for frame in open_dataset(bench.recording()).frames:
        if frame.name in cameras:
            yield replace(frame.read(), camera=cameras[frame.name])


def read_semantic_map(bench: BenchHome) -> SemanticMap:
    """Read the semantic map of a home; make it if it is missing.

    Args:
        bench: The home.

    Returns:
        The map with features of length `CODE`.

    Raises:
        OSError: A file cannot be read or written.
        ValueError: No map can be made.
    """
    gaussian_map = read_map(bench.map())

    def make(part: Path) -> None:
        found = embed_semantics(gaussian_map, mapped_frames(bench), Oracle(), CODE, threads=1)
        part.mkdir()
        np.save(part / "features.npy", found.features)
        assert isinstance(found.codec, Autoencoder)
        content = autoencoder_bytes(found.codec)
        write_atomic(part / f"{hashlib.sha256(content).hexdigest()}.safetensors", content)

    made_of = {
        "map": bench.mapped_of,
        "code": {"python": code_digest(__name__), "native": native_digest()},
    }
    folder = cached_folder(bench.work / "semantics" / bench.name, made_of, make)
    features = np.load(folder / "features.npy", allow_pickle=False)
    (path,) = folder.glob("*.safetensors")  # Named by its digest.
    return SemanticMap(replace(gaussian_map, features=features), read_autoencoder(path, path.stem))
