"""Command `gslts query`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.arguments import MapFolder, TextModelFolder
from gslts.cli.mapping import Threads

if TYPE_CHECKING:
    from gslts.semantics.queries import Instance, SemanticQueries

# Imports of commands are inside the functions, so that `gslts --help` answers at once.


def query(
    map_path: MapFolder,
    text: Annotated[str, typer.Argument(help='Object to find, such as "alarm clock".')],
    text_model: TextModelFolder = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    image: Annotated[
        Path | None, typer.Option(help="PNG to write: a heat map of relevance, and the boxes.")
    ] = None,
    threads: Threads = 0,
) -> None:
    """Find the objects in a map that match a text, and print their 3D boxes.

    Example: gslts query out/map "alarm clock" --image out/clock.png
    """
    from gslts.semantics.queries import SemanticQueries

    queries = SemanticQueries.of_map(map_path, text_model, threads)
    instances = queries.find(text)
    if explanation := queries.explain(text):
        typer.echo(explanation, err=True)
    if as_json:
        typer.echo(json.dumps([instance.to_json() for instance in instances]))
    elif not instances:
        typer.echo(f"{text}: not found")
    else:
        for instance in instances:
            typer.echo(f"{text} {describe_instance(instance)}")
    if image is not None and instances:
        _draw(map_path, queries, text, instances, image, threads)
        typer.echo(f"wrote {image}", err=as_json)


def _draw(
    map_path: Path,
    queries: SemanticQueries,
    text: str,
    instances: list[Instance],
    path: Path,
    threads: int,
) -> None:
    from gslts.io.image_files import write_image
    from gslts.semantics.query_image import draw_query
    from gslts.store.camera_files import cameras_of_map

    cameras = list(cameras_of_map(map_path).values())
    if not cameras:
        raise ValueError(f"{map_path}: --image needs a map with cameras; gslts map makes them")
    relevance = queries.relevance(text)
    drawn = draw_query(queries.gaussian_map, relevance, instances, cameras, threads)
    write_image(path, drawn)


def describe_instance(instance: Instance) -> str:
    """Describe position, size and score of an object.

    Args:
        instance: Result of a query.
    """
    x, y, z = instance.center
    width, depth, height = instance.high - instance.low
    size = f"{width:.2f} x {depth:.2f} x {height:.2f} m"
    return f"at ({x:.2f}, {y:.2f}, {z:.2f}) m, {size}, score {instance.score:.2f}"
