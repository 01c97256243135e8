"""Command `gslts view`."""

from __future__ import annotations

import sys
import threading
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.arguments import MapFolder, TextModelFolder

if TYPE_CHECKING:
    from gslts.viewer.viewer import Viewer

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
    live: Annotated[
        bool, typer.Option("--live", hidden=True, help="Show the frames of standard input.")
    ] = False,
    goals: Annotated[
        int | None, typer.Option(hidden=True, help="File descriptor that goals are written to.")
    ] = None,
) -> None:
    """Show a map and its history in the browser, and follow new versions.

    The map is only read. From another machine: ssh -L 8080:localhost:8080 HOST.

    Example: gslts view out/map
    """
    from gslts.cli.run import stop_signals
    from gslts.viewer.goals import GoalSender
    from gslts.viewer.viewer import Viewer

    send_goal = None if goals is None else GoalSender(goals).send
    with (
        stop_signals() as received,
        Viewer(map_path, host, port, token, text_model, send_goal) as viewer,
    ):
        ending = "/?token=TOKEN" if token else ""
        typer.echo(f"open {viewer.url}{ending} in a browser; Ctrl-C ends it")
        if live:
            threading.Thread(target=_show_live, args=(viewer,), daemon=True).start()
        while not received:
            viewer.wait(1)


def _show_live(viewer: Viewer) -> None:
    from gslts.viewer.live import read_live_frames

    for frame in read_live_frames(sys.stdin.buffer):
        viewer.show_robot(frame)
