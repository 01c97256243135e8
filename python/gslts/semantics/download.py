"""Messages about models that are missing; gslts downloads none itself."""

from __future__ import annotations

from pathlib import Path


def download_hint(folder: Path, example: str) -> str:
    """Return the command that downloads a model.

    Args:
        folder: Where the model is missing.
        example: Name of a public model.

    Returns:
        The end of an error message.
    """
    return f"download one with a network connection: hf download {example} --local-dir {folder}"


def require_folder(folder: Path, example: str) -> None:
    """Reject the path of a model that is no folder.

    Args:
        folder: The path.
        example: Name of a public model, for the message.

    Raises:
        FileNotFoundError: There is no such folder.
    """
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder; {download_hint(folder, example)}")
