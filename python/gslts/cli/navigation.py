"""The commands `gslts semantic-map` and `gslts go`: a map as a plan, and ways on it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.mapping import BAR

if TYPE_CHECKING:
    from gslts.core.robot import Robot
    from gslts.navigation.navigator import NavigationResult, Navigator
    from gslts.semantics.autoencoder import Autoencoder
    from gslts.semantics.source import SemanticSource

# What a command needs is imported inside it, so that `gslts --help` answers at once.

Folder = Annotated[Path, typer.Argument(metavar="MAP", help="Folder of a map.")]
Clip = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="CLIP that the map was taught with, if it has moved."),
]
Radius = Annotated[float, typer.Option(min=0.05, max=2, help="Of the robot, m.")]
Height = Annotated[float, typer.Option(min=0.1, max=5, help="Of the robot, m.")]
Step = Annotated[float, typer.Option(min=0, max=0.5, help="The robot drives over it, m.")]


def flatten(
    map_path: Folder,
    out: Annotated[Path, typer.Option(help="Folder for map.png, map.pgm and map.yaml.")],
    category: Annotated[
        list[str] | None, typer.Option(help="A layer, such as Mug; may be given again.")
    ] = None,
    cell: Annotated[
        float | None,
        typer.Option(min=0.01, max=1, help="Edge of a cell, m. Default: a quarter of --radius."),
    ] = None,
    radius: Radius = 0.2,
    height: Height = 1.2,
    step: Step = 0.02,
    clip: Clip = None,
) -> None:
    """Flatten a map to a plan of obstacles, of what was explored, and of categories.

    map.pgm and map.yaml are what map_server of ROS reads.

    Example: gslts semantic-map out/map --category Mug --category Sofa --out out/plan
    """
    from gslts.core.robot_body import RobotBody
    from gslts.navigation.semantic_map import make_semantic_map
    from gslts.navigation.semantic_map_files import (
        draw_semantic_map,
        write_map_server,
        write_picture,
    )
    from gslts.semantics.categories import Categories
    from gslts.store.map_folder import read_map

    body = RobotBody(radius_m=radius, height_m=height, step_m=step)
    layers = Categories(tuple(category), *_words(map_path, clip)) if category else None
    found = make_semantic_map(read_map(map_path), body, layers, cell)
    out.mkdir(parents=True, exist_ok=True)
    write_map_server(found, out)
    write_picture(draw_semantic_map(found), out / "map.png")
    missing = [name for name in found.categories if not found.category(name).any()]
    note = f"; not found: {', '.join(missing)}" if missing else ""
    size = found.grid.size
    typer.echo(f"wrote {size} x {size} cells of {found.grid.cell_m:g} m to {out}{note}")


def go(
    map_path: Folder,
    text: Annotated[str, typer.Argument(help='What to go to, such as "alarm clock".')],
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT",
            help="A simulated robot: day.json of gslts sim day, a scene change task, a home such "
            "as kitchen_3, or a .glb or .gltf file. Default: in the map itself.",
        ),
    ] = None,
    after: Annotated[
        int, typer.Option(min=0, help="Rounds of the day, or changes of the task, that are over.")
    ] = 0,
    watch: Annotated[
        bool,
        typer.Option("--watch", help="Look for changes on the way, and update the map with them."),
    ] = False,
    out: Annotated[Path, typer.Option(help="PNG of the way.")] = Path("go.png"),
    clip: Clip = None,
) -> None:
    """Let a robot go to the nearest thing that words name, and look at it.

    Without --robot, the way is tried out in the map: from where its first frame was taken, by a
    robot that sees what the map shows.

    With --watch, what is certain to have changed on the way becomes a version of the map, as with
    gslts run; then the robot goes on, with the new map if it did not find the thing with the old.

    Example: gslts go out/map "alarm clock" --robot out/day/day.json
    """
    from tqdm import tqdm

    from gslts.navigation.navigator import MAX_MOVES, Navigator
    from gslts.navigation.semantic_map_files import draw_semantic_map, write_picture
    from gslts.robots.sources import open_robot
    from gslts.store.map_folder import read_map

    if not text.strip():
        raise ValueError("TEXT: it is empty")
    words = _words(map_path, clip)
    scout = None if robot is None else open_robot(robot).robot(after)
    if watch and scout is None:
        raise ValueError("--watch needs a --robot: in the map, nothing changes")
    with tqdm(total=MAX_MOVES, desc="going", bar_format=BAR, disable=None) as bar:

        def tell() -> None:
            bar.update()

        if watch and scout is not None:
            navigator, found = _watching(map_path, scout, text, tell)
        else:
            navigator = Navigator(read_map(map_path), *words, categories=[text])
            found = navigator.go(scout or _in_the_map(map_path, navigator), text, tell)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_picture(draw_semantic_map(navigator.semantic_map, found.path), out)
    if found.status != "reached":
        raise RuntimeError(f"{text}: {found.status}: {found.reason}; see {out}")
    replans = f", planned anew {found.replans} times" if found.replans else ""
    typer.echo(
        f"reached the {text}: {found.length_m:.1f} m walked, stands {found.distance_m:.1f} m from "
        f"it{replans}; see {out}"
    )


def _in_the_map(map_path: Path, navigator: Navigator) -> Robot:
    from gslts.robots.in_map import MapRobot
    from gslts.store.camera_files import cameras_of_map

    first = next(iter(cameras_of_map(map_path).values()), None)
    if first is None:
        raise ValueError(f"{map_path}: it is not known where it was made from; give a --robot")
    return MapRobot(navigator.gaussian_map, navigator.semantic_map, navigator.body, first)


def _watching(
    map_path: Path, robot: Robot, text: str, tell: Callable[[], None]
) -> tuple[Navigator, NavigationResult]:
    from tqdm import tqdm

    from gslts.keeper.errand import run_errand
    from gslts.keeper.keeper import MapKeeper

    with MapKeeper(map_path, say=tqdm.write) as keeper:
        if keeper.semantics is None:
            raise ValueError(f"{map_path}: --watch needs the models that the map was taught with")
        return run_errand(keeper, keeper.semantics, robot, text, tell)


def _words(map_path: Path, clip: Path | None) -> tuple[Autoencoder, SemanticSource]:
    from gslts.semantics.files import require_semantics
    from gslts.semantics.registry import open_text_source

    setting, autoencoder = require_semantics(map_path)
    return autoencoder, open_text_source(setting, clip)
