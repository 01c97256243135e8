"""Adds semantic features to a map folder, as a new version."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from gslts.datasets import open_dataset
from gslts.semantics.autoencoder import CODE_DIMS, Autoencoder
from gslts.semantics.embed import embed_semantics
from gslts.semantics.files import write_autoencoder
from gslts.semantics.registry import SourceName, check_options, open_source, source_of_models
from gslts.store.camera_files import cameras_of_store
from gslts.store.causes import SemanticsCause
from gslts.store.fingerprints import is_recording_of
from gslts.store.map_folder import open_map
from gslts.store.records import Version
from gslts.store.trajectory_file import extension_by

Progress = Callable[[Iterable[Any]], Iterable[Any]]


def add_semantics(
    map_path: Path,
    dataset: Path,
    source: SourceName | None = None,
    models: dict[str, Path] | None = None,
    *,
    code_dims: int | None = None,
    layout: str | None = None,
    refine: int = 0,
    threads: int = 0,
    progress: Progress = lambda frames: frames,
) -> Version:
    """Compute semantic features for a map from the frames it was made from, and publish them.

    Args:
        map_path: Folder of the map.
        dataset: The dataset that the map was made from.
        source: "oracle" for ground-truth labels, "clip" for SAM and CLIP, "detector" for a detector
            or an instance segmentation network; None for the one whose models are given, or labels
            without any.
        models: Folders or files of weights and names; see `open_source`.
        code_dims: Length of a code, d, of an autoencoder; None for `CODE_DIMS`.
        layout: Layout of the outputs of a detector; None recognizes it.
        refine: Number of gradient steps after lifting.
        threads: 0 uses one per hardware thread.
        progress: Wraps the iterable of frames, such as tqdm.

    Returns:
        The new version of the map.

    Raises:
        ImportError: A package is missing.
        OSError: A file cannot be read or written.
        ValueError: The map was not made from these frames, was updated since, the source takes no
            such option, or it cannot segment a frame.
    """
    models = {name: folder.resolve() for name, folder in (models or {}).items()}
    source = source or source_of_models(models)
    settings = {"code_dims": code_dims, "layout": layout, "refine": refine or None}
    given = [name for name, value in settings.items() if value is not None]
    check_options(source, [*models, *given])
    with open_map(map_path, writable=True) as store:
        if any(version.kind == "update" for version in store.lineage()):
            raise ValueError(
                f"{map_path} was updated since {dataset} was recorded; gslts restore {map_path} 1 "
                "returns to the map of these frames"
            )
        gaussian_map, cameras = store.read(), cameras_of_store(store)
        opened = open_dataset(dataset)
        used = [frame for frame in opened.frames if frame.name in cameras]
        is_known = is_recording_of(map_path, opened) or extension_by(map_path, opened.name)
        if not used or not is_known:
            raise ValueError(
                f"{map_path} was made from no frame of {dataset}; give the dataset of gslts map"
            )
        segmenter = open_source(source, models, threads, layout)
        frames = (replace(frame.read(), camera=cameras[frame.name]) for frame in progress(used))
        semantics = embed_semantics(
            gaussian_map,
            frames,
            segmenter,
            CODE_DIMS if code_dims is None else code_dims,
            refine,
            threads,
        )
        codec = semantics.codec
        cause = SemanticsCause(
            source=source,
            dataset=opened.name,
            levels=semantics.features.shape[1] // codec.code_dims,
            code_dims=codec.code_dims,
            names=semantics.names,
            models={name: str(folder) for name, folder in models.items()},
            layout=layout,
            autoencoder=write_autoencoder(codec, map_path)
            if isinstance(codec, Autoencoder)
            else None,
        )
        with_features = replace(gaussian_map, features=semantics.features)
        return store.commit_features(with_features, cause)
