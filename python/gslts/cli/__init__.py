"""The command `gslts`."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from gslts.cli import mapping
from gslts.cli.sim import sim

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


class RoomName(StrEnum):
    """The rooms of `gslts.bench.rooms`."""

    S = "S"
    M = "M"
    L = "L"


@app.callback()
def describe() -> None:
    """Photorealistic, semantic 3D Gaussian maps that keep themselves up to date."""


@app.command()
def tradeoff(
    out: Annotated[Path, typer.Option(help="Folder for the CSV and the picture.")],
    scene: Annotated[RoomName, typer.Option(help="Synthetic room to render.")] = RoomName.M,
    threads: Annotated[int, typer.Option(min=0, help="0 means one a hardware thread.")] = 1,
    rounds: Annotated[int, typer.Option(min=1, help="Times each setting is measured.")] = 15,
) -> None:
    """Measure what each knob of the renderer costs in time and accuracy.

    Example: gslts tradeoff --scene M --out out/tradeoff
    """
    from tqdm import tqdm

    from gslts.bench import tradeoff
    from gslts.bench.rooms import NEAR_M, make_room
    from gslts.bench.tradeoff_plot import write_plot

    out.mkdir(parents=True, exist_ok=True)
    room = make_room(scene)
    points = tradeoff.measure(
        room.gaussian_map,
        room.camera,
        near_m=NEAR_M,
        threads=threads,
        rounds=rounds,
        progress=lambda steps: tqdm(steps, desc=f"room {scene}", unit="round"),
    )
    size = f"{room.gaussian_map.size:,} Gaussians, {room.camera.width} x {room.camera.height} px"
    csv_path, plot_path = out / f"tradeoff_{scene}.csv", out / f"tradeoff_{scene}.png"
    tradeoff.write_csv(points, csv_path)
    write_plot(points, f"Room {scene}: {size}, {threads} thread(s)", plot_path)
    default = points[0]
    typer.echo(
        f"default: {default.forward_ms:.2f} ms, {default.psnr_db:.1f} dB, "
        f"{'on' if default.on_front else 'NOT on'} the Pareto front"
    )
    typer.echo(f"wrote {csv_path} and {plot_path}")


def main() -> None:
    """Runs a command; what goes wrong ends in one line and a non-zero exit."""
    try:
        app(standalone_mode=True)
    except (OSError, ValueError, RuntimeError, ImportError, MemoryError) as error:
        message = " ".join(str(error).split()) or type(error).__name__
        print(f"gslts: {message}", file=sys.stderr)
        sys.exit(1)
