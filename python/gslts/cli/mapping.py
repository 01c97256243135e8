"""The commands `gslts map` and `gslts eval`."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

# What a command needs is imported inside it, so that `gslts --help` answers at once.


class Preset(StrEnum):
    """Speed against accuracy; see `gslts.mapping.config.PRESETS`."""

    FAST = "fast"
    BALANCED = "balanced"
    BEST = "best"


Dataset = Annotated[
    Path,
    typer.Argument(
        help="Folder in the layout of nerfstudio, 7-Scenes, TUM RGB-D or COLMAP, or a ROS 2 bag."
    ),
]
Map = Annotated[
    Path, typer.Argument(metavar="MAP", help="Folder of a map, or a .ply file of 3DGS.")
]
Threads = Annotated[int, typer.Option(min=0, help="0 means one a hardware thread.")]


def make(
    dataset: Dataset,
    out: Annotated[Path, typer.Option(help="Folder of the map; must not be there yet.")],
    preset: Annotated[Preset, typer.Option(help="Speed against accuracy.")] = Preset.BALANCED,
    iterations: Annotated[
        int | None, typer.Option(min=1, help="Instead of those of the preset.")
    ] = None,
    threads: Threads = 0,
) -> None:
    """Make a map of posed RGB-D frames; every eighth frame is kept aside to judge it.

    Example: gslts map out/kitchen_3 --out out/map
    """
    from dataclasses import asdict

    from tqdm import tqdm

    from gslts import __version__
    from gslts.datasets import open_dataset
    from gslts.map_folder import write_map_folder
    from gslts.mapping.config import PRESETS
    from gslts.mapping.engine import make_map
    from gslts.mapping.optimize import Progress

    if out.exists():
        raise FileExistsError(f"{out} is there already")
    given = {"threads": threads, **({} if iterations is None else {"iterations": iterations})}
    config = PRESETS[preset].model_copy(update=given)
    opened = open_dataset(dataset)
    with tqdm(total=config.iterations, desc="mapping", unit="step", smoothing=0.05) as bar:

        def report(progress: Progress) -> None:
            bar.set_postfix(
                loss=f"{progress.loss:.3f}",
                psnr=f"{progress.psnr_db:.1f}",
                gaussians=progress.gaussians,
                refresh=False,
            )
            bar.update()

        result = make_map(
            opened,
            config,
            show_frames=lambda frames: tqdm(frames, desc="reading", unit="frame"),
            report=report,
        )
    manifest = {
        "gslts": __version__,
        "dataset": opened.name,
        "config": config.model_dump(),
        "seeds": result.seeds,
        "held_out": asdict(result.held_out),
        "skipped": list(result.skipped),
    }
    write_map_folder(out, result.gaussian_map, manifest, result.cameras)
    quality = result.held_out
    typer.echo(
        f"wrote {out}: {result.gaussian_map.size} Gaussians; {quality.frames} frames kept aside: "
        f"{quality.psnr_db:.1f} dB, SSIM {quality.ssim:.3f}, depth {100 * quality.depth_l1_m:.1f} "
        f"cm off; {len(result.skipped)} frames skipped"
    )


def judge(
    map_path: Map,
    dataset: Dataset,
    every: Annotated[int, typer.Option(min=1, help="Use every so manieth frame.")] = 8,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    threads: Threads = 0,
    lpips_backbone: Annotated[
        Path | None, typer.Option(help="Weights of torchvision's AlexNet, for LPIPS.")
    ] = None,
    lpips_heads: Annotated[
        Path | None, typer.Option(help="alex.pth of the package lpips, for LPIPS.")
    ] = None,
) -> None:
    """Compare a map with frames, their exposure fitted and their poses as given.

    Example: gslts eval out/map out/kitchen_3
    """
    from dataclasses import asdict

    from gslts.datasets import open_dataset
    from gslts.lpips import Lpips
    from gslts.map_folder import ply_of, read_map
    from gslts.mapping.assess import assess
    from gslts.mapping.evaluate import evaluate

    lpips = None
    if lpips_backbone is not None and lpips_heads is not None:
        lpips = Lpips(lpips_backbone, lpips_heads)
    elif lpips_backbone is not None or lpips_heads is not None:
        raise ValueError("LPIPS needs both --lpips-backbone and --lpips-heads")
    gaussian_map = read_map(map_path)
    ply_bytes = ply_of(map_path).stat().st_size
    frames = [frame.read() for frame in open_dataset(dataset).frames[::every]]
    quality = evaluate(gaussian_map, frames, threads)
    rest = assess(gaussian_map, frames, lpips, threads)
    per_gaussian = ply_bytes / max(1, gaussian_map.size)
    if as_json:
        sizes = {
            "gaussians": gaussian_map.size,
            "ply_bytes": ply_bytes,
            "bytes_per_gaussian": per_gaussian,
        }
        typer.echo(json.dumps({**asdict(quality), **asdict(rest), **sizes}))
        return
    typer.echo(
        f"{quality.frames} frames: {quality.psnr_db:.2f} dB, SSIM {quality.ssim:.3f}, depth "
        f"{100 * quality.depth_l1_m:.2f} cm off"
    )
    typer.echo(
        f"{gaussian_map.size} Gaussians in {ply_bytes} bytes, {per_gaussian:.1f} each; "
        f"{rest.render_ms:.1f} ms a rendering"
    )
    typer.echo(
        "no LPIPS: it needs weights, --lpips-backbone and --lpips-heads"
        if rest.lpips is None
        else f"LPIPS {rest.lpips:.4f}"
    )
