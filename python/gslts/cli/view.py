"""Command `gslts view`."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from gslts.cli.arguments import MapFolder, TextModelFolder

# Imports of commands are inside the functions, so that `gslts --help` answers at once.


def view(
    map_path: MapFolder,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 for a free one.")] = 8080,
    host: Annotated[
        str, typer.Option(help="Address to bind; any but this machine's own needs --token.")
    ] = "127.0.0.1",
    token: Annotated[
        str | None,
        typer.Option(
            envvar="GSLTS_VIEW_TOKEN",
            help="Secret of 16 characters or more that a browser must show.",
        ),
    ] = None,
    text_model: TextModelFolder = None,
) -> None:
    """Show a map and its history in the browser, and follow new versions.

    The map is only read. From another machine: ssh -L 8080:localhost:8080 HOST.

    Example: gslts view out/map
    """
    from gslts.cli.run import stop_signals
    from gslts.viewer.viewer import Viewer

    with stop_signals() as received, Viewer(map_path, host, port, token, text_model) as viewer:
        ending = "/?token=TOKEN" if token else ""
        typer.echo(f"open {viewer.url}{ending} in a browser; Ctrl-C ends it")
        while not received:
            viewer.wait(1)


@contextmanager
def viewed(map_path: Path, wanted: bool) -> Iterator[None]:
    """Serve `gslts view` beside a command, in a process of its own that cannot slow it.

    Args:
        map_path: Folder of the map.
        wanted: False does nothing.
    """
    command = [sys.executable, "-m", "gslts", "view", str(map_path), "--port", "0"]
    process = subprocess.Popen(command) if wanted else None
    try:
        yield
    finally:
        if process is not None:
            process.terminate()
            process.wait()
