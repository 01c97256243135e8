"""The command `gslts demo`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from gslts.cli.arguments import Control, require_view
from gslts.cli.mapping import Threads

# What a command needs is imported inside it, so that `gslts --help` answers at once.


def demo(
    out: Annotated[Path, typer.Option(help="New or empty folder for all results.")] = Path("demo"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Smaller images and shorter refinements.")
    ] = False,
    view: Annotated[
        bool, typer.Option("--view", help="Also show the robot and its map in the browser.")
    ] = False,
    control: Control = False,
    threads: Threads = 0,
) -> None:
    """Let a simulated robot map a home and keep the map up to date for a day of changes.

    Example: gslts demo --quick --out out/demo
    """
    from tqdm import tqdm

    from gslts_bench.demo import QUICK, Scale, run_day

    require_view(view, control)

    def bar(items: Iterable[Any], stage: str) -> Iterable[Any]:
        shown: Iterable[Any] = tqdm(items, desc=stage, leave=False, disable=None)
        return shown

    scale = QUICK if quick else Scale()
    report = run_day(
        out, scale, threads=threads, bar=bar, say=tqdm.write, view=view, control=control
    )
    typer.echo(f"look at {report.resolve()}")
    typer.echo(f"and at the map and its day: gslts view {out / 'map'}")
