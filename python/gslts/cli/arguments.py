"""Arguments that several commands share."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Annotated

import typer

from gslts.fleet.url import is_url


def _read_map(text: str) -> Path:
    """Return the path of a map; of a URL, that of a clone with the newest version."""
    if not is_url(text):
        return Path(text)
    from gslts.fleet.cache import cached_clone

    url, version = re.fullmatch(r"(.+?)(@\d{1,9})?", text).groups()  # type: ignore[union-attr]
    folder = cached_clone(url)
    return folder.with_name(f"{folder.name}{version or ''}")


def _write_map(context: typer.Context, text: str) -> Path:
    """Return the path of a map; of a URL, that of a clone that is pushed after the command."""
    path = _read_map(text)
    if is_url(text):
        context.call_on_close(lambda: _push(path))
    return path


def _push(path: Path) -> None:
    """Push a clone, also after a command that failed: what it committed before counts."""
    from gslts.fleet.exchange import push_map

    failed = sys.exc_info()[0] is not None
    try:
        done = push_map(path)
    except (OSError, ValueError) as error:
        text = f"{error}; what was not pushed stays in {path}: gslts push {path} tries again"
        if not failed:
            raise OSError(text) from error
        print(f"gslts: not pushed: {text}", file=sys.stderr)  # The command has its own error.
        return
    for reason in done.given_up:
        typer.echo(f"given up: {reason}")
    if done.pushed:
        typer.echo(f"version {done.version.number} is pushed")


Folder = Annotated[Path, typer.Argument(metavar="MAP", help="Folder of a map.")]
MapFolder = Annotated[
    Path,
    typer.Argument(
        metavar="MAP",
        parser=str,
        callback=_read_map,
        help="Folder of a map, or the URL of a shared one.",
    ),
]
Map = Annotated[
    Path,
    typer.Argument(
        metavar="MAP",
        parser=str,
        callback=_read_map,
        help="Folder or URL of a map, or a .ply, .glb or .spz file of 3DGS.",
    ),
]
WritableMap = Annotated[
    Path,
    typer.Argument(
        metavar="MAP",
        parser=str,
        callback=_write_map,
        help="Folder of a map, or the URL of a shared one, to which new versions are pushed.",
    ),
]
TextModelFolder = Annotated[
    Path | None,
    typer.Option(
        "--text-model",
        "--clip",
        metavar="DIR",
        help="Sentence embeddings for words beyond those of a detector, or the CLIP of the map, "
        "if it was moved.",
    ),
]
Control = Annotated[
    bool,
    typer.Option("--control", help="With --view: whoever looks can send the robot to an object."),
]


def require_view(view: bool, control: bool) -> None:
    """Require the viewer of a robot that is driven from it.

    Args:
        view: Option `--view`.
        control: Option `--control`.

    Raises:
        ValueError: The robot should be driven, and there is no viewer.
    """
    if control and not view:
        raise ValueError("--control: goals are chosen in the browser; give --view as well")
