"""Semantic sources by name, and by the cause of a version; models are loaded only when needed."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Literal

from gslts.semantics.calibration import calibrate
from gslts.semantics.files import require_semantics
from gslts.semantics.source import Codec, Oracle, SemanticSource
from gslts.store.causes import SemanticsCause
from gslts.store.map_folder import read_map

SourceName = Literal["oracle", "clip", "detector"]

OPTIONS: dict[SourceName, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "oracle": ((), ("code_dims", "refine")),
    "clip": (("clip", "sam"), ("code_dims", "refine")),
    "detector": (("model", "names"), ("text_model", "layout")),
}
"""Models that each source needs, and further models and settings that it takes."""


def source_of_models(names: Iterable[str]) -> SourceName:
    """Return the source that needs some of the models; "oracle", of labels, without any.

    Args:
        names: Names of models, such as "clip" and "sam".
    """
    given = set(names)
    return next((source for source, (needed, _) in OPTIONS.items() if given & {*needed}), "oracle")


def check_options(name: SourceName, given: Collection[str]) -> None:
    """Check that a source takes the options that are given, and has those that it needs.

    Args:
        name: Name of the source.
        given: Names of models and settings, as in `OPTIONS`.

    Raises:
        ValueError: An option is missing, or would not be used.
    """
    needed, optional = OPTIONS[name]
    needless = sorted({*given} - {*needed, *optional})
    if needless:
        taken = _flags((*needed, *optional))
        raise ValueError(f"the source {name} takes no {_flags(needless)}; it takes {taken}")
    if not {*needed} <= {*given}:
        got = _flags(sorted(given)) or "none"
        raise ValueError(f"the source {name} needs {_flags(needed, ' and ')}, got {got}")


def _flags(names: Iterable[str], separator: str = ", ") -> str:
    """Return options as a user of the command writes them."""
    return separator.join(f"--{name.replace('_', '-')}" for name in names)


def open_text_source(
    cause: SemanticsCause, text_model: Path | None = None, threads: int = 0
) -> SemanticSource:
    """Open the source of a map for text queries only.

    Args:
        cause: Cause of the version that added the semantic features.
        text_model: Folder of CLIP, or of a model of sentence embeddings for a map of a detector;
            None for the recorded one. The names of a detector need none.
        threads: For CLIP; 0 uses the default of torch.

    Returns:
        The source; it encodes texts.

    Raises:
        ImportError: A package is missing.
        OSError: A folder or file is missing.
        ValueError: No folder of CLIP is recorded, or the weights are damaged.
    """
    if cause.source == "oracle":
        return Oracle()
    key, option = ("clip", "--clip") if cause.source == "clip" else ("text_model", "--text-model")
    recorded = cause.models.get(key)
    folder = text_model or (Path(recorded) if recorded else None)
    if folder is not None and not folder.is_dir():
        raise FileNotFoundError(
            f"{folder}: the {'CLIP' if key == 'clip' else 'text'} model of the semantics of this "
            f"map is not there; give its folder with {option} DIR"
        )
    if cause.source == "detector":
        from gslts.semantics.class_names import ClassNames
        from gslts.semantics.detector_source import DetectorSource
        from gslts.semantics.text_model import TextModel

        embeddings = None if folder is None else TextModel(folder)
        return DetectorSource(ClassNames(cause.names, embeddings))
    if folder is None:
        raise ValueError("the map does not record the folder of its CLIP: give --clip DIR")
    from gslts.semantics.clip_source import ClipSource

    return ClipSource.from_folders(folder, threads=threads)


def open_text_semantics(
    path: Path, text_model: Path | None = None, threads: int = 0, *, calibrated: bool = True
) -> tuple[Codec, SemanticSource]:
    """Open the semantics of a map folder for text queries.

    Args:
        path: A map folder with semantic features, or a version of it such as MAP@3.
        text_model: Folder of a text model; see `open_text_source`.
        threads: For CLIP; 0 uses the default of torch.
        calibrated: Whether the source gets the threshold of the map, which is read for it.

    Returns:
        The codec of its features, and the source that encodes texts.

    Raises:
        ImportError: A package is missing.
        OSError: A file cannot be read.
        ValueError: The map has no semantic features, or its source takes no text model, or a file
            is damaged.
    """
    cause, codec = require_semantics(path)
    if text_model is not None and cause.source == "oracle":
        raise ValueError(f"{path}: its words are those of labels: leave out --text-model")
    source = open_text_source(cause, text_model, threads)
    return codec, calibrate_in(path, source, codec) if calibrated else source


def calibrate_in(path: Path, source: SemanticSource, codec: Codec) -> SemanticSource:
    """Calibrate a source in a map folder, which is read only if the source needs it.

    Args:
        path: A map folder, or a version of it such as MAP@3.
        source: Of its features.
        codec: Of its features.

    Returns:
        See `calibrate`.

    Raises:
        OSError: A file cannot be read.
        ValueError: A file is damaged.
    """
    return calibrate(source, read_map(path), codec) if source.unrelated else source


def open_source(
    name: SourceName, models: dict[str, Path], threads: int = 0, layout: str | None = None
) -> SemanticSource:
    """Open a source that segments frames and encodes texts.

    Args:
        name: Name of the source.
        models: Folders or files, by the names of `OPTIONS`.
        threads: For CLIP and SAM; 0 uses the default of torch.
        layout: Layout of the outputs of a detector; None recognizes it.

    Returns:
        The source.

    Raises:
        ImportError: A package is missing.
        OSError: A folder or file is missing; the message says how to get it.
        ValueError: A model is not given, or is damaged.
    """
    check_options(name, models)
    if name == "oracle":
        return Oracle()
    if name == "detector":
        from gslts.semantics.detector_source import DetectorSource

        return DetectorSource.from_files(
            models["model"], models["names"], layout, models.get("text_model")
        )
    from gslts.semantics.clip_source import ClipSource

    return ClipSource.from_folders(models["clip"], models["sam"], threads)
