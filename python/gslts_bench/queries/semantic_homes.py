"""Maps of homes whose Gaussians know words, by the labels of the simulator; made once."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import open_dataset
from gslts.io.atomic_files import write_whole
from gslts.semantics.autoencoder import Autoencoder, autoencoder_bytes, read_autoencoder
from gslts.semantics.embed import embed_semantics
from gslts.semantics.source import Oracle
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import read_map
from gslts_bench.cache import cached_folder, code_digest, native_digest
from gslts_bench.homes import BenchHome, Tell

SEMANTICS_S = 35.0
"""About how long that takes for 200 frames, for the progress."""
FEATURES, AUTOENCODER = "features.npy", ".safetensors"
"""Files; the second is named by the SHA-256 of its content."""
CODE = 32


@dataclass(frozen=True, eq=False)
class TaughtMap:
    """A map that knows words.

    Attributes:
        gaussian_map: With features.
        autoencoder: Of the features.
    """

    gaussian_map: GaussianMap
    autoencoder: Autoencoder


def frames_of(bench: BenchHome, tell: Tell = lambda _: None) -> Iterator[RgbdFrame]:
    """Those that the map of a home was made from, at the poses that mapping found."""
    cameras = cameras_of_map(bench.map(tell))
    frames = open_dataset(bench.recording(tell)).frames
    known = [one for one in frames if one.name in cameras]
    for one in known:
        yield replace(one.read(), camera=cameras[one.name])
        tell(SEMANTICS_S / len(known))


def taught(bench: BenchHome, tell: Tell = lambda _: None) -> TaughtMap:
    """The map of a home with what its Gaussians mean, made unless it is there.

    Args:
        bench: The home.
        tell: Is told of work done, in the seconds that it usually takes.

    Raises:
        OSError: It cannot be read or written.
        ValueError: No map can be made.
    """
    folder = bench.map(tell)
    gaussian_map = read_map(folder)

    def make(part: Path) -> None:
        found = embed_semantics(gaussian_map, frames_of(bench, tell), Oracle(), CODE, threads=1)
        part.mkdir()
        np.save(part / FEATURES, found.features)
        content = autoencoder_bytes(found.autoencoder)
        write_whole(part / f"{hashlib.sha256(content).hexdigest()}{AUTOENCODER}", content)

    made_of = {
        "map": bench.mapped_of,
        "code": {"python": code_digest(__name__), "native": native_digest()},
    }
    own = cached_folder(bench.work / "semantics" / bench.name, made_of, make)
    features = np.load(own / FEATURES, allow_pickle=False)
    (path,) = own.glob(f"*{AUTOENCODER}")
    return TaughtMap(replace(gaussian_map, features=features), read_autoencoder(path, path.stem))
