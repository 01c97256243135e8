"""Commands `gslts semantic-map` and `gslts go`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.arguments import Map, MapFolder, TextModelFolder
from gslts.cli.mapping import BAR

if TYPE_CHECKING:
    from gslts.core.robot import Robot
    from gslts.navigation.navigator import Navigator
    from gslts.navigation.trip import NavigationResult

# Imports of commands are inside the functions, so that `gslts --help` answers at once.

Radius = Annotated[float, typer.Option(min=0.05, max=2, help="Radius of the robot, m.")]
Height = Annotated[float, typer.Option(min=0.1, max=5, help="Height of the robot, m.")]
Step = Annotated[
    float, typer.Option(min=0, max=0.5, help="Maximum height the robot drives over, m.")
]


def semantic_map(
    map_path: Map,
    out: Annotated[Path, typer.Option(help="Folder for map.png, map.pgm and map.yaml.")],
    category: Annotated[
        list[str] | None, typer.Option(help="A layer, such as Mug; repeat for more.")
    ] = None,
    cell: Annotated[
        float | None,
        typer.Option(min=0.01, max=1, help="Edge of a cell, m. Default: a quarter of --radius."),
    ] = None,
    radius: Radius = 0.2,
    height: Height = 1.2,
    step: Step = 0.02,
    text_model: TextModelFolder = None,
) -> None:
    """Make a 2D semantic map: obstacles, explored area, and a layer per category.

    map.pgm and map.yaml are files of the map_server of ROS.

    Example: gslts semantic-map out/map --category Mug --category Sofa --out out/plan
    """
    from gslts.core.robot_body import RobotBody
    from gslts.io.image_files import write_image
    from gslts.navigation.semantic_map import make_semantic_map
    from gslts.navigation.semantic_map_files import draw_semantic_map, write_map_server
    from gslts.navigation.upright import require_upright
    from gslts.semantics.categories import Categories
    from gslts.semantics.registry import open_text_semantics
    from gslts.store.map_folder import read_map

    require_upright(map_path)
    body = RobotBody(radius_m=radius, height_m=height, step_m=step)
    layers = None
    if category:
        layers = Categories(tuple(category), *open_text_semantics(map_path, text_model))
    result = make_semantic_map(read_map(map_path), body, layers, cell)
    out.mkdir(parents=True, exist_ok=True)
    write_map_server(result, out)
    write_image(out / "map.png", draw_semantic_map(result))
    missing = [name for name in result.categories if not result.category(name).any()]
    note = f"; not found: {', '.join(missing)}" if missing else ""
    size = result.grid.size
    typer.echo(f"wrote {size} x {size} cells of {result.grid.cell_m:g} m to {out}{note}")


def go(
    map_path: MapFolder,
    text: Annotated[str, typer.Argument(help='Object to go to, such as "alarm clock".')],
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT",
            help="A simulated robot: day.json of gslts sim day, a scene change task, a home such "
            "as kitchen_3, or a .glb or .gltf file. Default: a robot in the map itself.",
        ),
    ] = None,
    after: Annotated[
        int, typer.Option(min=0, help="Rounds of the day, or changes of the task, to skip.")
    ] = 0,
    watch: Annotated[
        bool,
        typer.Option("--watch", help="Detect changes on the way, and update the map with them."),
    ] = False,
    out: Annotated[Path, typer.Option(help="PNG of the path.")] = Path("go.png"),
    text_model: TextModelFolder = None,
) -> None:
    """Navigate a robot to the nearest object that matches a text, and look at it.

    Without --robot, navigation is tried in the map: the robot starts at its first camera, or on the
    free floor nearest to it, and sees renderings of the map.

    With --watch, confident changes on the way become a version of the map, as with gslts run. If
    the robot did not find the object with the old map, it tries again with the new one.

    Example: gslts go out/map "alarm clock" --robot out/day/day.json
    """
    from tqdm import tqdm

    from gslts.io.image_files import write_image
    from gslts.navigation.navigator import Navigator
    from gslts.navigation.semantic_map_files import draw_semantic_map
    from gslts.navigation.walk import MAX_MOVES
    from gslts.robots.sources import open_robot

    if not text.strip():
        raise ValueError("TEXT: expected the name of an object, got nothing")
    if watch and robot is None:
        raise ValueError("--watch needs a --robot: in the map, nothing changes")
    opened = None if robot is None else open_robot(robot).robot(after)
    navigator = (
        None if watch else Navigator.of_map(map_path, categories=[text], text_model=text_model)
    )
    with tqdm(total=MAX_MOVES, desc="going", bar_format=BAR, disable=None) as bar:

        def on_move() -> None:
            bar.update()

        if navigator is None:
            assert opened is not None
            navigator, result = _go_and_watch(map_path, opened, text, on_move)
        else:
            result = navigator.go(opened or _robot_in_map(map_path, navigator), text, on_move)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_image(out, draw_semantic_map(navigator.semantic_map, result.path))
    if result.status != "reached":
        raise RuntimeError(f"{text}: {result.status}: {result.reason}; see {out}")
    replans = f", planned again {result.replans} times" if result.replans else ""
    typer.echo(
        f"reached the {text}: path of {result.length_m:.1f} m, ends {result.distance_m:.1f} m from "
        f"it{replans}; see {out}"
    )


def _robot_in_map(map_path: Path, navigator: Navigator) -> Robot:
    from gslts.robots.in_map import MapRobot
    from gslts.store.camera_files import cameras_of_map

    first = next(iter(cameras_of_map(map_path).values()), None)
    if first is None:
        raise ValueError(f"{map_path}: the map has no cameras to start at; give a --robot")
    return MapRobot(navigator.gaussian_map, navigator.semantic_map, navigator.body, first)


def _go_and_watch(
    map_path: Path, robot: Robot, text: str, on_move: Callable[[], None]
) -> tuple[Navigator, NavigationResult]:
    from tqdm import tqdm

    from gslts.keeper.errand import run_errand
    from gslts.keeper.keeper import MapKeeper
    from gslts.navigation.upright import require_upright
    from gslts.semantics.files import require_semantics

    require_semantics(map_path)
    require_upright(map_path)
    with MapKeeper(map_path, log=tqdm.write) as keeper:
        if keeper.semantics is None:
            raise ValueError(f"{map_path}: --watch needs the models of the semantics of the map")
        return run_errand(keeper, keeper.semantics, robot, text, on_move)
