"""The source of meaning that a name, or what a map keeps, stands for."""

from __future__ import annotations

from pathlib import Path

from gslts.semantics.source import Oracle, SemanticSource
from gslts.store.causes import SemanticsCause


def open_text_source(
    setting: SemanticsCause, clip: Path | None = None, threads: int = 0
) -> SemanticSource:
    """That of the words of a map.

    Args:
        setting: Of the map.
        clip: Folder of its CLIP, if it is no longer where it was.
        threads: Of the models; 0 means as many as torch takes.

    Raises:
        ImportError: transformers is missing.
        OSError: A folder or file is missing; the message tells which.
        ValueError: The weights are damaged.
    """
    if setting.source == "oracle":
        return Oracle()
    known = setting.models.get("clip")
    folder = clip or (Path(known) if known else None)
    if folder is None:
        raise ValueError("the map does not tell which CLIP it knows words from: give --clip DIR")
    if not folder.is_dir():
        raise FileNotFoundError(
            f"{folder}: the CLIP that this map was taught with is not there; --clip DIR tells where"
        )
    from gslts.semantics.clip import ClipEncoder
    from gslts.semantics.clip_source import ClipSource

    return ClipSource(ClipEncoder(folder, threads))


def open_source(name: str, models: dict[str, Path], threads: int = 0) -> SemanticSource:
    """One that can also tell what frames show.

    Args:
        name: "oracle" or "clip".
        models: Folders of the weights: "clip" and "sam" for "clip", none for "oracle".
        threads: Of the models; 0 means as many as torch takes.

    Raises:
        ImportError: transformers is missing.
        OSError: A folder or file is missing; the message tells how to get it.
        ValueError: A model is not named, or its weights are damaged.
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
