"""The command `gslts`."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from gslts.cli import history, mapping, navigation, output, tasks
from gslts.cli.bench import bench
from gslts.cli.demo import demo
from gslts.cli.detect import detect
from gslts.cli.locate import locate
from gslts.cli.run import run
from gslts.cli.sim import sim
from gslts.cli.tradeoff import tradeoff
from gslts.cli.update import update

# What a command needs is imported inside it, so that `gslts --help` answers at once.

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # Errors in one line and not in a box.
)
app.add_typer(sim, name="sim")
app.command("map")(mapping.make)
app.command("eval")(mapping.judge)
app.command("render")(output.render)
app.command("export")(output.export)
app.command("locate")(locate)
app.command("detect")(detect)
app.command("update")(update)
app.command("run")(run)
app.command("demo")(demo)
app.command("log")(history.log)
app.command("show")(history.show)
app.command("diff")(history.diff)
app.command("restore")(history.restore)
app.command("verify")(history.verify)
app.command("gc")(history.gc)
app.command("import")(history.import_ply)
app.command("semantics")(tasks.semantics)
app.command("query")(tasks.query)
app.command("semantic-map")(navigation.flatten)
app.command("go")(navigation.go)
app.command("tradeoff")(tradeoff)
app.add_typer(bench, name="bench")


def _tell_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        from gslts._core import simd

        typer.echo(f"gslts {version('gslts')} ({simd.target()})")
        raise typer.Exit


@app.callback()
def describe(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_tell_version,
            is_eager=True,
            help="Tell the version and the instruction set in use.",
        ),
    ] = False,
) -> None:
    """Photorealistic, semantic 3D Gaussian maps that keep themselves up to date."""


def main() -> None:
    """Runs a command; what goes wrong ends in one line and a non-zero exit."""
    try:
        if os.environ.get("GSLTS_SIMD"):
            from gslts._core import simd

            simd.target()  # Says what this machine lacks before anything is done.
        app(standalone_mode=True)
    except (OSError, ValueError, RuntimeError, ImportError, MemoryError) as error:
        message = " ".join(str(error).split()) or type(error).__name__
        print(f"gslts: {message}", file=sys.stderr)
        sys.exit(1)
