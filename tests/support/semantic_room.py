"""The map of `change_room` with semantic features of its labels."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import change_room
import numpy as np
from safetensors.numpy import load_file, save_file
from shared import made_once, viewpoints_all_around

from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.autoencoder import Autoencoder
from gslts.semantics.embed import SemanticFeatures, embed_semantics
from gslts.semantics.map_semantics import MapSemantics
from gslts.semantics.source import Oracle
from gslts_sim.robot_body import Viewpoint


@cache
def viewpoints() -> list[Viewpoint]:
    """Return views of the whole room, and those of the block."""
    return [*viewpoints_all_around("change_room", change_room.home(), 16), *change_room.VIEWPOINTS]


def frames() -> list[RgbdFrame]:
    """Return the frames at `viewpoints`."""
    return [change_room.see(change_room.home(), viewpoint) for viewpoint in viewpoints()]


@cache
def embedded_map() -> tuple[GaussianMap, SemanticFeatures]:
    """Return the map with features, and the features; made once per run."""
    gaussian_map, _ = change_room.mapped()

    def make(folder: Path) -> None:
        folder.mkdir()
        found = embed_semantics(gaussian_map, frames(), Oracle(), 8, threads=1)
        np.save(folder / "features.npy", found.features)
        save_file(dict(found.codec.weights), folder / "autoencoder.safetensors")
        (folder / "names.json").write_text(json.dumps(found.names))

    folder = made_once("change_room_semantics", make)
    features = np.load(folder / "features.npy")
    codec = Autoencoder(load_file(folder / "autoencoder.safetensors"))
    names = tuple(json.loads((folder / "names.json").read_text()))
    return replace(gaussian_map, features=features), SemanticFeatures(features, codec, names)


def map_semantics() -> MapSemantics:
    """Return the semantics of the map, as updates need them."""
    _, found = embedded_map()
    return MapSemantics(Oracle(), found.codec, found.names)
