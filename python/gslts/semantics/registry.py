"""Semantic sources by name, and by the cause of a version; models are loaded only when needed."""

from __future__ import annotations

from pathlib import Path

from gslts.semantics.autoencoder import Autoencoder
from gslts.semantics.files import require_semantics
from gslts.semantics.source import Oracle, SemanticSource
from gslts.store.causes import SemanticsCause


def open_text_source(
    cause: SemanticsCause, clip: Path | None = None, threads: int = 0
) -> SemanticSource:
    """Open the source of a map for text queries only: of the models, CLIP is enough.

    Args:
        cause: Cause of the version that added the semantic features.
        clip: Folder of CLIP; None for the recorded one.
        threads: For the model; 0 uses the default of torch.

    Returns:
        The source; it encodes texts.

    Raises:
        ImportError: transformers is missing.
        OSError: A folder or file is missing.
        ValueError: No folder of CLIP is recorded, or the weights are damaged.
    """
    if cause.source == "oracle":
        return Oracle()
    recorded = cause.models.get("clip")
    folder = clip or (Path(recorded) if recorded else None)
    if folder is None:
        raise ValueError("the map does not record the folder of its CLIP: give --clip DIR")
    if not folder.is_dir():
        raise FileNotFoundError(
            f"{folder}: the CLIP model of the semantics of this map is not there; give its folder "
            "with --clip DIR"
        )
    from gslts.semantics.clip import ClipEncoder
    from gslts.semantics.clip_source import ClipSource

    return ClipSource(ClipEncoder(folder, threads))


def open_text_semantics(
    path: Path, clip: Path | None = None, threads: int = 0
) -> tuple[Autoencoder, SemanticSource]:
    """Open the semantics of a map folder for text queries.

    Args:
        path: A map folder with semantic features, or a version of it such as MAP@3.
        clip: Folder of its CLIP, if it was moved.
        threads: For CLIP; 0 uses the default of torch.

    Returns:
        The autoencoder of its features, and the source that encodes texts.

    Raises:
        ImportError: transformers is missing.
        OSError: A file cannot be read.
        ValueError: The map has no semantic features, or a file is damaged.
    """
    cause, autoencoder = require_semantics(path)
    return autoencoder, open_text_source(cause, clip, threads)


def open_source(name: str, models: dict[str, Path], threads: int = 0) -> SemanticSource:
    """Open a source that segments frames and encodes texts.

    Args:
        name: "oracle" or "clip".
        models: Folders of weights: "clip" and "sam" for the source "clip", none for "oracle".
        threads: For the models; 0 uses the default of torch.

    Returns:
        The source.

    Raises:
        ImportError: transformers is missing.
        OSError: A folder or file is missing; the message says how to get it.
        ValueError: A model is not given, or its weights are damaged.
    """
    if name == "oracle":
        if models:
            raise ValueError(f"the source oracle takes no model, got --{min(models)}")
        return Oracle()
    if set(models) != {"clip", "sam"}:
        raise ValueError("the source clip needs both models: --clip DIR and --sam DIR")
    from gslts.semantics.clip import ClipEncoder
    from gslts.semantics.clip_source import ClipSource
    from gslts.semantics.sam import MaskGenerator

    return ClipSource(ClipEncoder(models["clip"], threads), MaskGenerator(models["sam"], threads))
