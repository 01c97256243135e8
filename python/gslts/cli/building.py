"""Commands of buildings: `gslts building`."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.arguments import TextModelFolder
from gslts.cli.mapping import Threads

if TYPE_CHECKING:
    from gslts.fleet.building import Building
    from gslts.fleet.building_history import RoomHistory
    from gslts.fleet.building_query import BuildingAnswer
    from gslts.fleet.building_route import Route

# Imports are inside the commands, so that `gslts --help` starts fast.

building = typer.Typer(no_args_is_help=True, help="Many rooms with maps of their own, and doors.")

UNITS_S = {"min": 60, "h": 3600, "days": 86400}
"""Units of ages, s, the smallest first."""

File = Annotated[
    str, typer.Argument(metavar="FILE", help="building.json, on this disk or behind a URL.")
]
OwnFile = Annotated[str, typer.Argument(metavar="FILE", help="building.json on this disk.")]
Text = Annotated[str, typer.Argument(metavar="WORDS", help='Object, such as "alarm clock".')]
RoomArgument = Annotated[str, typer.Argument(metavar="ROOM", help="Name of the room.")]


def _read_duration_s(text: str) -> float:
    """Return a duration such as 90m, 24h or 7d in seconds."""
    match = re.fullmatch(r"(\d{1,6})([mhd])", text)
    if match is None:
        raise ValueError(f"--since: expected a duration such as 90m, 24h or 7d, got {text!r}")
    return int(match[1]) * {"m": 60.0, "h": 3600.0, "d": 86400.0}[match[2]]


@building.command()
def add(
    file: OwnFile,
    room: RoomArgument,
    map_path: Annotated[
        str, typer.Argument(metavar="MAP", help="Folder of the map, or the URL of a shared one.")
    ],
    transform: Annotated[
        Path | None,
        typer.Option(
            help="Text file of 4 x 4 numbers, building_from_map, m. Default: the map is in the "
            "frame of the building."
        ),
    ] = None,
) -> None:
    """Add a room to the file of a building, and make the file if there is none.

    Example: gslts building add home/building.json kitchen home/kitchen
    """
    from gslts.fleet.building_edit import add_room

    changed = add_room(file, room, map_path, transform)
    typer.echo(f"{file}: {_count(changed)}")


@building.command(context_settings={"ignore_unknown_options": True})
def door(
    file: OwnFile,
    room: RoomArgument,
    other: Annotated[str, typer.Argument(metavar="ROOM", help="Name of the room behind it.")],
    x: Annotated[float, typer.Argument(help="Middle of the doorway, building frame, m.")],
    y: Annotated[float, typer.Argument(help="See X.")],
    z: Annotated[float, typer.Argument(help="Height of its floor, m.")] = 0.0,
) -> None:
    """Add a door between two rooms to the file of a building.

    The maps of both rooms must show free floor there.

    Example: gslts building door home/building.json kitchen hall 3.2 1.5
    """
    from gslts.fleet.building_edit import add_door

    changed = add_door(file, (room, other), (x, y, z))
    typer.echo(f"{file}: {_count(changed)}")


@building.command()
def show(
    file: File,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    since: Annotated[
        str, typer.Option(metavar="DURATION", help="List changes of this time: 90m, 24h, 7d.")
    ] = "24h",
) -> None:
    """List the rooms with the ages of their maps, robots and new changes, and the doors.

    A map is observed when a robot makes a version of it, or rejects an update.

    Example: gslts building show s3://maps/building.json
    """
    from gslts.fleet.building import Building

    now_s = time.time()
    since_s = now_s - _read_duration_s(since)
    opened = Building.read(file)
    histories, problems = opened.histories(since_s)
    if as_json:
        rooms = {
            name: {"map": room.map}
            | (histories[name].model_dump() if name in histories else {"error": problems[name]})
            for name, room in opened.rooms.items()
        }
        doors = [door.model_dump() for door in opened.doors]
        typer.echo(json.dumps({"rooms": rooms, "doors": doors}, indent=1))
    else:
        _print_rooms(opened, histories, problems, now_s)
        for door in opened.doors:
            typer.echo(str(door))
    if problems:
        raise RuntimeError(f"{file}: {len(problems)} map(s) cannot be read, named above")


@building.command()
def query(
    file: File,
    text: Text,
    text_model: TextModelFolder = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    threads: Threads = 0,
) -> None:
    """Find the objects in all rooms that match a text, the best first.

    Example: gslts building query home/building.json "alarm clock"
    """
    from gslts.cli.query import describe_instance
    from gslts.fleet.building import Building

    answer = Building.read(file).query(text, text_model, threads)
    _print_silent(answer)
    if as_json:
        found = [{"room": item.room, **item.instance.to_json()} for item in answer.found]
        typer.echo(json.dumps(found))
    for item in () if as_json else answer.found:
        typer.echo(f"{text} in {item.room} {describe_instance(item.instance)}")
    if not as_json and not answer.found:
        typer.echo(f"{text}: not found")
    if answer.problems:
        raise RuntimeError(f"{file}: {len(answer.problems)} map(s) cannot be read, named above")


@building.command()
def go(
    file: File,
    text: Text,
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT", help="Robot in the frame of the building, as for gslts go; it moves."
        ),
    ] = None,
    start: Annotated[
        tuple[str, float, float] | None,
        typer.Option(
            "--from", metavar="ROOM X Y", help="Position in the building frame, m: only a plan."
        ),
    ] = None,
    after: Annotated[
        int, typer.Option(min=0, help="Rounds of the day, or changes of the task, to skip.")
    ] = 0,
    text_model: TextModelFolder = None,
) -> None:
    """Navigate through doors to the nearest object that matches a text.

    The route is the shortest one, to free floor within a metre of the object.

    Example: gslts building go home/building.json "alarm clock" --from bedroom 1.5 4.0

    Example: gslts building go home/building.json "alarm clock" --robot flat_3
    """
    import numpy as np

    from gslts.fleet.building import Building
    from gslts.fleet.building_trip import go_through_building
    from gslts.robots.sources import open_robot

    if (robot is None) == (start is None):
        raise ValueError("give either a --robot, or a start with --from ROOM X Y")
    opened = Building.read(file)
    if start is not None and start[0] not in opened.rooms:
        opened.map_path(start[0])
    answer = opened.query(text, text_model)
    _print_silent(answer)
    if start is not None:
        route = opened.plan(answer, np.array(start[1:]), start[0])
        if route.reason:
            raise RuntimeError(f"{text}: {route.reason}")
        _print_route(route, text)
        return
    assert robot is not None
    result = go_through_building(
        opened,
        answer,
        open_robot(robot).robot(after),
        text_model,
        on_route=lambda route: _print_route(route, text),
    )
    if result.status != "reached":
        raise RuntimeError(f"{text}: {result.status}: {result.reason}")
    typer.echo(
        f"reached the {text}: path of {result.length_m:.1f} m, ends {result.distance_m:.1f} m from "
        "it"
    )


def _print_rooms(
    opened: Building,
    histories: Mapping[str, RoomHistory],
    problems: Mapping[str, str],
    now_s: float,
) -> None:
    """Print a table of the rooms, with changes below each."""
    robots = {name: ", ".join(history.robots) or "-" for name, history in histories.items()}
    width, robots_width = (
        max(map(len, names)) for names in (("room", *opened.rooms), ("robots", *robots.values()))
    )
    typer.echo(
        f"{'room':{width}}  version  Gaussians  changed  observed  {'robots':{robots_width}}  map"
    )
    for name, room in opened.rooms.items():
        if name in problems:
            typer.echo(f"{name:{width}}  cannot be read: {problems[name]}")
            continue
        history = histories[name]
        changed, observed = (
            _format_age(now_s - time_s) for time_s in (history.changed_s, history.observed_s)
        )
        typer.echo(
            f"{name:{width}}  {history.version:7}  {history.gaussians:9}  {changed:>7}  "
            f"{observed:>8}  {robots[name]:{robots_width}}  {room.map}"
        )
        for change in history.changes:
            typer.echo(
                f"{'':{width}}  {change.text}: version {change.version}, "
                f"{_format_age(now_s - change.time_s)} ago, by {change.robot or '-'}"
            )


def _print_silent(answer: BuildingAnswer) -> None:
    """Print the rooms that gave no answer."""
    for room, problem in answer.problems.items():
        typer.echo(f"{room}: cannot be read: {problem}", err=True)
    for room in answer.without_words:
        typer.echo(f"{room}: its map has no semantic features; it was not asked", err=True)


def _print_route(route: Route, text: str) -> None:
    from gslts.cli.query import describe_instance
    from gslts.fleet.building_file import Door

    found = route.found
    typer.echo(
        f"{text} in {found.room} {describe_instance(found.instance)}: {route.length_m:.1f} m"
    )
    for leg in route.legs:
        to = f"to the {leg.end}" if isinstance(leg.end, Door) else f"to the {text}"
        typer.echo(f"  {leg.room}: {leg.length_m:.1f} m {to}")


def _format_age(age_s: float) -> str:
    """Format an age in its largest unit; a clock that is ahead gives a negative one."""
    size_s, unit = max(
        ((size_s, unit) for unit, size_s in UNITS_S.items() if size_s <= abs(age_s)),
        default=(1, "s"),
    )
    return f"{age_s / size_s:.0f} {unit}"


def _count(opened: Building) -> str:
    return f"{len(opened.rooms)} room(s), {len(opened.doors)} door(s)"
