"""The command `gslts`."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from gslts.cli import mapping, output
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
app.command("render")(output.render)
app.command("export")(output.export)


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
    map_path: Annotated[
        Path | None, typer.Option("--map", help="A map to render instead: its folder or .ply file.")
    ] = None,
    pose: output.Pose = None,
) -> None:
    """Measure what each knob of the renderer costs in time and accuracy.

    A map is rendered from the view of --pose, or from that of its first camera.

    Example: gslts tradeoff --scene M --out out/tradeoff
    """
    from tqdm import tqdm

    from gslts.bench import tradeoff
    from gslts.bench.rooms import NEAR_M, make_room
    from gslts.bench.tradeoff_plot import write_plot
    from gslts.map_folder import read_map
    from gslts.render import RenderOptions

    if map_path is not None:
        gaussian_map, camera = read_map(map_path), output.find_camera(map_path, pose)
        name, title, near_m = map_path.resolve().stem, f"Map {map_path}", RenderOptions().near_m
    elif pose is not None:
        raise ValueError("--pose is for maps: give --map")
    else:
        room = make_room(scene)
        gaussian_map, camera = room.gaussian_map, room.camera
        name, title, near_m = scene, f"Room {scene}", NEAR_M
    out.mkdir(parents=True, exist_ok=True)
    points = tradeoff.measure(
        gaussian_map,
        camera,
        near_m=near_m,
        threads=threads,
        rounds=rounds,
        progress=lambda steps: tqdm(steps, desc=title, unit="round"),
    )
    size = f"{gaussian_map.size:,} Gaussians, {camera.width} x {camera.height} px"
    csv_path, plot_path = out / f"tradeoff_{name}.csv", out / f"tradeoff_{name}.png"
    tradeoff.write_csv(points, csv_path)
    write_plot(points, f"{title}: {size}, {threads} thread(s)", plot_path)
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
