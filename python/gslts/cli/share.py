"""Commands of shared maps: clone, push, pull."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.arguments import Folder

if TYPE_CHECKING:
    from gslts.fleet.exchange import Exchange

# Imports are inside the commands, so that `gslts --help` starts fast.

Url = Annotated[
    str, typer.Argument(metavar="URL", help="Shared map: s3://, gs://, az:// or file://.")
]
KnownUrl = Annotated[
    str | None,
    typer.Argument(metavar="[URL]", help="Shared map; by default that of the last exchange."),
]


def clone(
    url: Url, folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="New folder.")]
) -> None:
    """Copy a shared map into a new folder, which works without a network from then on.

    Credentials come from the environment, as for other programs of the store.

    Example: gslts clone s3://maps/flat out/map
    """
    from gslts.fleet.exchange import clone_map

    version = clone_map(url, folder)
    typer.echo(f"{folder} is version {version.number}: {version.gaussians} Gaussians")


def pull(map_path: Folder, url: KnownUrl = None) -> None:
    """Bring the versions of other robots into a map; own versions follow them.

    Own changes elsewhere keep their result and get new numbers. Own changes of a region that others
    changed, too, are verified anew, and given up if the map shows them already or others saw the
    object later; gslts log names the reason.

    Example: gslts pull out/map
    """
    from gslts.fleet.exchange import pull_map

    _echo(map_path, pull_map(map_path, url))


def push(map_path: Folder, url: KnownUrl = None) -> None:
    """Give the versions of a map to other robots, after those that came before (gslts pull).

    A new URL gets the whole map. GSLTS_ROBOT names this robot in gslts log; it is the host by
    default.

    Example: gslts push out/map s3://maps/flat
    """
    from gslts.fleet.exchange import push_map

    _echo(map_path, push_map(map_path, url))


def _echo(map_path: Path, done: Exchange) -> None:
    for reason in done.given_up:
        typer.echo(f"given up: {reason}")
    typer.echo(
        f"{map_path} is version {done.version.number}: {done.pulled} pulled, {done.pushed} pushed"
    )
