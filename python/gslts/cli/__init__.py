"""The command `gslts`."""

from __future__ import annotations

import os
import re
import sys
from importlib.metadata import entry_points, requires
from typing import Annotated

import typer

from gslts.cli import history, mapping, navigation, output
from gslts.cli.building import building
from gslts.cli.consolidate import consolidate
from gslts.cli.detect import detect
from gslts.cli.evaluation import judge
from gslts.cli.extend import extend
from gslts.cli.localize import localize
from gslts.cli.query import query
from gslts.cli.ros import ros
from gslts.cli.run import run
from gslts.cli.semantics import semantics
from gslts.cli.share import clone, pull, push
from gslts.cli.update import update
from gslts.cli.view import view
from gslts.io.messages import to_line

# What a command needs is imported inside it, so that `gslts --help` answers at once.

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # Errors in one line and not in a box.
)
app.command("map")(mapping.make)
app.command("eval")(judge)
app.command("render")(output.render)
app.command("export")(output.export)
app.command("view")(view)
app.command("localize")(localize)
app.command("detect")(detect)
app.command("update")(update)
app.command("extend")(extend)
app.command("consolidate")(consolidate)
app.command("run")(run)
app.command("ros")(ros)
app.command("log")(history.log)
app.command("show")(history.show)
app.command("diff")(history.diff)
app.command("restore")(history.restore)
app.command("verify")(history.verify)
app.command("gc")(history.gc)
app.command("import")(history.import_map)
app.command("clone")(clone)
app.command("pull")(pull)
app.command("push")(push)
app.add_typer(building, name="building")
app.command("semantics")(semantics)
app.command("query")(query)
app.command("semantic-map")(navigation.semantic_map)
app.command("go")(navigation.go)
for entry in entry_points(group="gslts.commands"):  # Of installed packages: the simulator's, ...
    command = entry.load()
    if isinstance(command, typer.Typer):
        app.add_typer(command, name=entry.name)
    else:
        app.command(entry.name)(command)


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
    """Photorealistic, semantic 3D Gaussian maps that robots keep up to date by themselves.

    Example: gslts map RECORDING --out out/map
    """


def extra_with(module: str) -> str:
    """Say which extra brings a package that is missing, for the end of a message.

    Args:
        module: Name of a module of the package, which is named like the package.

    Returns:
        The command, after a colon; "" if no extra brings it.
    """
    package = re.escape(module.partition(".")[0])
    for requirement in requires("gslts") or []:
        found = re.match(rf"{package}(?![\w\[-]).*extra == ['\"]([\w-]+)", requirement)
        if found:
            return f": pip install 'gslts[{found[1]}]'"
    return ""


def _in_one_line(error: Exception) -> str:
    """Return the message of an error, those of the system without their numbers."""
    text = str(error)
    if isinstance(error, OSError) and error.filename is not None and error.strerror is not None:
        text = f"{os.fsdecode(error.filename)}: {error.strerror}"
    return to_line(text) or type(error).__name__


def main() -> None:
    """Run a command; an error is one line on stderr and a non-zero exit status."""
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")  # Damage of images is in the error.
    try:
        import gslts._cpu  # noqa: F401  # An ImportError says what this processor lacks.

        if os.environ.get("GSLTS_SIMD"):
            from gslts._core import simd

            simd.target()  # Says what this machine lacks before anything is done.
        app(standalone_mode=True)
    except (OSError, ValueError, RuntimeError, ImportError, MemoryError) as error:
        message = _in_one_line(error)
        if isinstance(error, ModuleNotFoundError) and error.name:
            message += extra_with(error.name)
        print(f"gslts: {message}", file=sys.stderr)
        sys.exit(1)
