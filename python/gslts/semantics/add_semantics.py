"""A map folder is taught words: a version whose Gaussians have features."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from gslts.datasets import open_dataset
from gslts.semantics.embed import embed_semantics
from gslts.semantics.files import write_autoencoder
from gslts.semantics.registry import open_source
from gslts.store.camera_files import cameras_of_map
from gslts.store.causes import SemanticsCause
from gslts.store.map_folder import open_map
from gslts.store.records import Version

Show = Callable[[Iterable[Any]], Iterable[Any]]


def add_semantics(
    map_path: Path,
    dataset: Path,
    source: Literal["oracle", "clip"] = "oracle",
    models: dict[str, Path] | None = None,
    *,
    code: int = 32,
    refine: int = 0,
    threads: int = 0,
    show: Show = lambda frames: frames,
) -> Version:
    """Lifts what frames mean to the Gaussians of a map.

    Args:
        map_path: Its folder.
        dataset: Of the frames that it was made from.
        source: Of the meaning.
        models: Folders of its weights; see `open_source`.
        code: Numbers that a Gaussian keeps of an embedding, d.
        refine: Steps of gradient descent after the lifting.
        threads: 0 means one a hardware thread.
        show: Is given the frames, and shows how far they are read.

    Returns:
        The new version of the map.

    Raises:
        ImportError: A package is missing.
        OSError: Something cannot be read or written.
        ValueError: The map was not made from these frames, has changed since, or a frame has not
            what the source needs.
    """
    models = {name: folder.resolve() for name, folder in (models or {}).items()}
    teacher = open_source(source, models, threads)
    opened, cameras = open_dataset(dataset), cameras_of_map(map_path)
    known = [frame for frame in opened.frames if frame.name in cameras]
    if not known:
        raise ValueError(f"{map_path} was made from no frame of {dataset}")
    with open_map(map_path, writable=True) as store:
        if any(version.kind == "update" for version in store.lineage()):
            raise ValueError(
                f"{map_path} has changed since {dataset} was recorded; gslts restore {map_path} 1 "
                "goes back to what it shows"
            )
        gaussian_map = store.read()
        frames = (replace(one.read(), camera=cameras[one.name]) for one in show(known))
        found = embed_semantics(gaussian_map, frames, teacher, code, refine, threads)
        setting = SemanticsCause(
            source=source,
            dataset=opened.name,
            levels=found.features.shape[1] // code,
            code=code,
            names=found.names,
            models={name: str(folder) for name, folder in models.items()},
            autoencoder=write_autoencoder(found.autoencoder, map_path),
        )
        taught = replace(gaussian_map, features=found.features)
        return store.commit_features(taught, setting)
