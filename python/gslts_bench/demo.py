"""Demonstration: a simulated home is mapped, changes for a day, and the map is kept up to date."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.se3 import pose_distance
from gslts.datasets import open_dataset
from gslts.io.atomic_files import empty_folder, write_atomic
from gslts.io.data_urls import png_of
from gslts.io.html_page import number, plots, section, table
from gslts.keeper.config import KeeperConfig
from gslts.keeper.describe import describe_keeper
from gslts.keeper.errand import drive_to
from gslts.keeper.keeper import MapKeeper
from gslts.localization.config import RelocalizationConfig
from gslts.localization.relocalizer import Relocalizer
from gslts.localization.side_by_side import side_by_side
from gslts.mapping.config import PRESETS, MappingConfig
from gslts.mapping.engine import make_map
from gslts.mapping.report.summary import summary_of, write_result
from gslts.navigation.navigator import Navigator
from gslts.navigation.semantic_map_files import draw_semantic_map
from gslts.robots.watched import WatchedRobot
from gslts.semantics.add_semantics import add_semantics
from gslts.semantics.map_semantics import MapSemantics
from gslts.semantics.query_image import draw_query
from gslts.store.camera_files import cameras_of_map
from gslts.store.history_page import write_history
from gslts.store.map_folder import open_map, read_map
from gslts.store.records import Event
from gslts.update.config import RefineConfig, UpdateConfig
from gslts.viewer.beside import PagesBeside, viewer_beside
from gslts_bench.days.events import was_found
from gslts_bench.series.run import mean_psnr_db, new_frames
from gslts_sim import make_home
from gslts_sim.actions import SceneState
from gslts_sim.capture import capture
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.controller import Controller
from gslts_sim.day import Day, make_day
from gslts_sim.explore import explore
from gslts_sim.home import Home, Room
from gslts_sim.home_source import HomeSource
from gslts_sim.procedural.flat import open_door
from gslts_sim.procedural.homes import ROOM_TYPES
from gslts_sim.procedural.model import Kit
from gslts_sim.ray_scene import require_embree

ROOM, SEED, CHANGES = "living_room", 7, 6
"""Home of the demonstration, and number of its changes."""
NEXT_ROOM = "bedroom"
"""Room behind the door that opens after the last change."""
EVENING_FRAMES = 12
"""Number of frames recorded after the day, for detection against the map of the morning."""

Bar = Callable[[Iterable[Any], str], Iterable[Any]]
"""Wraps items to show the progress of a stage, which is named."""


@dataclass(frozen=True)
class Scale:
    """Size of the demonstration.

    Attributes:
        width, height: Size of the images, px.
        frames: Maximum number of frames of the recording.
        mapping: Settings of the mapping.
        iterations: Maximum number of iterations of a refinement.
        new_views: Number of viewpoints that judge the map at the end.
    """

    width: int = 640
    height: int = 480
    frames: int = 150
    mapping: MappingConfig = PRESETS["fast"]
    iterations: int = 250
    new_views: int = 20


QUICK = Scale(
    width=320,
    height=240,
    frames=90,
    mapping=PRESETS["fast"].model_copy(update={"budget_s": 20.0}),
    iterations=100,
    new_views=10,
)
"""Scale of `gslts demo --quick`."""


def run_day(
    out: Path,
    scale: Scale,
    *,
    threads: int,
    bar: Bar,
    say: Callable[[str], None],
    view: bool = False,
    control: bool = False,
) -> Path:
    """Map a home and keep the map up to date for a day.

    Args:
        out: New or empty folder: gets day.json, before/, map/, after/ and report.html.
        scale: Size of the demonstration.
        threads: 0 means one per hardware thread.
        bar: Shows progress.
        say: Receives messages.
        view: Show the map and the robot in the browser as soon as there is a map.
        control: Let people who look send the robot to objects.

    Returns:
        File of the report.

    Raises:
        ImportError: A package is missing; there is no folder then.
        OSError: A file cannot be written.
        ValueError: The folder is not empty.
    """
    require_embree()
    empty_folder(out)
    seconds: dict[str, float] = {}
    start_s = time.perf_counter()

    def note(stage: str) -> None:
        seconds[stage] = time.perf_counter() - start_s - sum(seconds.values())

    day, home = _make_day(out, scale)
    robot = day.robot(home, 0)
    viewpoints, _ = explore(robot.home, scale.frames, lambda places: bar(places, "exploring"))
    count = capture(robot, bar(viewpoints, "recording"), out / "before")
    note("recording")
    say(f"recorded {count} frames of a {ROOM.replace('_', ' ')}")
    say(f"mapped it: {_make_map(out, scale, threads, bar)}")
    note("mapping")
    add_semantics(
        out / "map",
        out / "before",
        threads=threads,
        progress=lambda frames: bar(frames, "semantics"),
    )
    say("added semantics from the simulator's labels")
    note("adding semantics")
    config = KeeperConfig(
        update=UpdateConfig(threads=threads, refine=RefineConfig(iterations=scale.iterations)),
        extension=scale.mapping.model_copy(update={"threads": threads, "budget_s": None}),
    )
    evening = _open_door(day, home)
    with viewer_beside(out / "map", view, control) as pages:
        _go_rounds(out / "map", day, home, evening, config, bar, say, pages)
    known = day.state(home, len(day.rounds)).home  # The room of the morning.
    capture(_robot_in(evening, day), explore(known, EVENING_FRAMES)[0], out / "after")
    note("keeping it up to date")
    report = out / "report.html"
    with open_map(out / "map") as store:
        events = store.events()
        walk = _walk(out / "map", _robot_in(evening, day), _relocated_type(day, home, events), say)
        note("a query and a walk")
        frames = new_frames(SceneState(evening), day.sensor, SEED, scale.new_views)
        sections = [
            section("True changes", _truth(day, events)),
            section("Path to a relocated object", walk),
            section("Localization of an image", _localize(out / "map", frames[0], threads, say)),
            section("Quality of the map at the end", _quality(out, evening, frames)),
            section("Seconds", table(("", "s"), [(k, f"{v:.0f}") for k, v in seconds.items()])),
        ]
        write_history(report, store, f"A day in a {ROOM.replace('_', ' ')}", sections)
    return report


def _make_day(out: Path, scale: Scale) -> tuple[Day, Home]:
    """Make the changes of a day, write them to day.json, and load the home before them."""
    source, coarse = HomeSource.of_seed(ROOM, SEED)
    day = make_day(
        source, coarse, TaskSettings(width=scale.width, height=scale.height), SEED, CHANGES
    )
    write_atomic(out / "day.json", (day.model_dump_json(indent=1) + "\n").encode())
    return day, source.load(out)


def _open_door(day: Day, home: Home) -> Home:
    """Return the home after the day, with the next room behind its open door."""
    after = day.state(home, len(day.rounds)).home
    return open_door(after, make_home(NEXT_ROOM, SEED), Kit((SEED, len(ROOM_TYPES)), 1.0))


def _robot_in(home: Home, day: Day) -> Controller:
    """Return the robot in the evening."""
    sensor, seed = day.sensor, day.sensor.seed_after + len(day.rounds) + 1
    size = {"width": sensor.width, "height": sensor.height}
    return Controller(home, **size, noise=sensor.noise, seed=seed)


def _go_rounds(
    folder: Path,
    day: Day,
    home: Home,
    evening: Home,
    config: KeeperConfig,
    bar: Bar,
    say: Callable[[str], None],
    pages: PagesBeside,
) -> None:
    """Keep the map up to date through the rounds of the day, and extend it in the evening."""
    with MapKeeper(folder, config, log=lambda words: say(f"  {words}")) as keeper:

        def go_round(driven: Controller) -> WatchedRobot:
            def show(frame: RgbdFrame) -> None:
                pages.show(frame, lambda: describe_keeper(keeper))

            def follow_goal() -> None:
                pages.follow_goal(
                    lambda goal: drive_to(keeper, robot, goal.words, goal.box).describe()
                )

            robot = WatchedRobot(driven, show)
            keeper.go_round(robot, between=follow_goal)
            return robot

        for gone, happened in enumerate(bar(day.rounds, "rounds"), start=1):
            for event in happened:
                say(f"{event.change.kind} of {event.change.object_id}")
            go_round(day.robot(home, gone))
        say(f"the door to the {NEXT_ROOM} opens")
        robot = go_round(_robot_in(evening, day))
        keeper.explore(robot)


def _make_map(out: Path, scale: Scale, threads: int, bar: Bar) -> str:
    dataset = open_dataset(out / "before")
    config = scale.mapping.model_copy(update={"threads": threads})
    shares = iter(bar(range(100), "mapping"))
    shown = [0]

    def report(progress: Any) -> None:
        while shown[0] < 100 * progress.share and next(shares, None) is not None:
            shown[0] += 1

    result = make_map(
        dataset, config, show_frames=lambda frames: bar(frames, "reading"), report=report
    )
    write_result(out / "map", result, dataset.name)
    return summary_of(result)


def _relocated_type(day: Day, home: Home, events: Sequence[Event]) -> str:
    """Return the type of a relocated object, if possible one that was found and is unique."""
    changes = [event.change for happened in day.rounds for event in happened]
    types = [known.type for known in day.state(home, len(day.rounds)).home.objects]
    moved = [change for change in changes if change.kind == "relocation"]
    best = max(
        moved, key=lambda change: (was_found(change, events), -types.count(change.object_type))
    )
    return best.object_type


def _walk(folder: Path, robot: Controller, name: str, say: Callable[[str], None]) -> str:
    """Ask the map for an object and send the robot there; return both as images."""
    semantics, gaussian_map = MapSemantics.of_map(folder), read_map(folder)
    assert semantics is not None  # They were added above.
    navigator = Navigator(gaussian_map, semantics.codec, semantics.source, categories=[name])
    found = navigator.queries.find(name)
    images = []
    if found:
        x, y, z = found[0].center
        say(f"asked for the {name}: at ({x:.2f}, {y:.2f}, {z:.2f}) m")
        cameras = list(cameras_of_map(folder).values())
        fits = navigator.queries.relevance(name)
        images.append((f"{name}: found", draw_query(gaussian_map, fits, found, cameras)))
    journey = navigator.go(robot, name)
    outcome = journey.describe()
    say(f"went to the {name}: {outcome}")
    images.append(
        (f"The path to it: {outcome}", draw_semantic_map(navigator.semantic_map, journey.path))
    )
    return plots(*((words, png_of(image)) for words, image in images)) + table(
        (), [(f"{name}, {journey.status}", outcome)]
    )


def _truth(day: Day, events: Sequence[Event]) -> str:
    rows = [
        (
            str(number_of_round),
            event.change.kind,
            event.change.object_type,
            "yes" if was_found(event.change, events) else "no",
        )
        for number_of_round, happened in enumerate(day.rounds)
        for event in happened
    ]
    return table(("before round", "change", "object", "found and repaired"), rows)


def _localize(folder: Path, frame: RgbdFrame, threads: int, say: Callable[[str], None]) -> str:
    """Localize a frame in the map without a prior."""
    start_s = time.perf_counter()
    relocalizer = Relocalizer.of_map(folder, RelocalizationConfig(threads=threads))
    found = relocalizer.localize(frame)
    took = f"after {time.perf_counter() - start_s:.1f} s"
    pose = found.world_from_camera
    if pose is None:
        say(f"localized an image: {found.status}: {found.reason}, {took}")
        return table((), [(found.status, found.reason)])
    metres, turn_rad = pose_distance(frame.camera.world_from_camera, pose)
    off = f"{1000 * metres:.0f} mm and {np.degrees(turn_rad):.2f} degrees off"
    say(f"localized an image: {found.status}, {off}, {took}")
    image = png_of(side_by_side(relocalizer.gaussian_map, frame, pose, threads))
    return plots(("The image, and the map from its pose", image)) + table(
        (), [(found.status, f"{off}, {took}")]
    )


def _quality(out: Path, home: Home, frames: Sequence[RgbdFrame]) -> str:
    """Return the PSNR of the maps of morning and evening, in each room."""
    maps = {"as mapped in the morning": "map@1", "as it is in the evening": "map"}
    parts = [[frame for frame in frames if _is_in(frame, room)] for room in home.rooms]
    rows = []
    for words, path in maps.items():
        known = read_map(out / path)
        figures = [number(mean_psnr_db(known, part)) if part else "" for part in parts]
        rows.append((words, f"{known.size:,}", *figures))
    rooms = (
        f"{len(part)} new viewpoints in the {room.type.replace('_', ' ')}, dB"
        for room, part in zip(home.rooms, parts, strict=True)
    )
    return table(("map", "Gaussians", *rooms), rows)


def _is_in(frame: RgbdFrame, room: Room) -> bool:
    position = frame.camera.world_from_camera[:3, 3]
    return bool(((position > room.box[0]) & (position < room.box[1])).all())
