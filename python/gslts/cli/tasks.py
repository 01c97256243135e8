"""The commands that put a map to use: semantics, query."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gslts.cli.mapping import Dataset, Threads

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from gslts.core.gaussian_map import GaussianMap
    from gslts.semantics.queries import Instance

# What a command needs is imported inside it, so that `gslts --help` answers at once.

Folder = Annotated[Path, typer.Argument(metavar="MAP", help="Folder of a map.")]


class Source(StrEnum):
    """Of what pictures mean."""

    ORACLE = "oracle"
    CLIP = "clip"


def semantics(
    map_path: Folder,
    dataset: Dataset,
    source: Annotated[
        Source,
        typer.Option(help="Where meaning is from: the labels of a data set, or SAM and CLIP."),
    ] = Source.ORACLE,
    clip: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="CLIP of transformers: config, safetensors, tokenizer."),
    ] = None,
    sam: Annotated[
        Path | None, typer.Option(metavar="DIR", help="SAM of transformers: config, safetensors.")
    ] = None,
    code: Annotated[
        int, typer.Option(min=8, max=64, help="Numbers that a Gaussian keeps of an embedding.")
    ] = 32,
    refine: Annotated[
        int, typer.Option(min=0, help="Steps of gradient descent after the lifting.")
    ] = 0,
    threads: Threads = 0,
) -> None:
    """Teach a map what its Gaussians mean, from the frames that it was made from.

    Example: gslts semantics out/map out/day/before

    Example: gslts semantics out/map out/visit --source clip --clip models/clip --sam models/sam
    """
    import time

    from tqdm import tqdm

    from gslts.semantics.add_semantics import add_semantics

    models = {name: one for name, one in (("clip", clip), ("sam", sam)) if one}
    start_s = time.perf_counter()
    version = add_semantics(
        map_path,
        dataset,
        source.value,
        models,
        code=code,
        refine=refine,
        threads=threads,
        show=lambda frames: tqdm(frames, desc="teaching", unit="frame", disable=None),
    )
    typer.echo(
        f"{map_path} is version {version.number} now: its Gaussians know words, after "
        f"{time.perf_counter() - start_s:.0f} s"
    )


def query(
    map_path: Folder,
    text: Annotated[str, typer.Argument(help='What to look for, such as "alarm clock".')],
    clip: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="CLIP that the map was taught with, if it has moved."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    picture: Annotated[
        Path | None, typer.Option(help="PNG of how well everything fits, and of the boxes.")
    ] = None,
    threads: Threads = 0,
) -> None:
    """Tell where in a map something is.

    Example: gslts query out/map "alarm clock" --picture out/clock.png
    """
    from gslts.semantics.files import require_semantics
    from gslts.semantics.queries import SemanticQueries
    from gslts.semantics.registry import open_text_source
    from gslts.store.map_folder import read_map

    setting, autoencoder = require_semantics(map_path)
    gaussian_map = read_map(map_path)
    queries = SemanticQueries(gaussian_map, autoencoder, open_text_source(setting, clip, threads))
    found = queries.find(text)
    if as_json:
        typer.echo(json.dumps([_plain(one) for one in found]))
    elif not found:
        typer.echo(f"{text}: not found")
    else:
        for one in found:
            typer.echo(f"{text} {_words(one)}")
    if picture is not None and found:
        _draw(map_path, gaussian_map, queries.relevance(text), found, picture, threads)


def _draw(
    map_path: Path,
    gaussian_map: GaussianMap,
    fits: NDArray[np.float32],
    found: list[Instance],
    picture: Path,
    threads: int,
) -> None:
    from PIL import Image

    from gslts.semantics.query_image import draw_query
    from gslts.store.camera_files import cameras_of_map

    cameras = list(cameras_of_map(map_path).values())
    if not cameras:
        raise ValueError(f"{map_path}: nobody knows from where to show it: it has no cameras")
    Image.fromarray(draw_query(gaussian_map, fits, found, cameras, threads)).save(picture)
    typer.echo(f"see {picture}", err=True)


def _words(one: Instance) -> str:
    x, y, z = one.middle
    width, depth, height = one.high - one.low
    size = f"{width:.2f} x {depth:.2f} x {height:.2f} m"
    return f"at ({x:.2f}, {y:.2f}, {z:.2f}) m, {size}, score {one.score:.2f}"


def _plain(one: Instance) -> dict[str, Any]:
    return {
        "low_m": one.low.tolist(),
        "high_m": one.high.tolist(),
        "corners_m": one.corners.tolist(),
        "score": one.score,
        "gaussians": len(one.rows),
    }
