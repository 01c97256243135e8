"""The command `gslts run`."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gslts.cli.arguments import Control, WritableMap, require_view
from gslts.cli.localize import Localize, localizer_of, read_recording
from gslts.cli.mapping import BAR, Threads

if TYPE_CHECKING:
    from gslts.core.camera import Camera
    from gslts.core.frame import RgbdFrame
    from gslts.core.robot import Robot
    from gslts.keeper.config import KeeperConfig
    from gslts.robots.sources import RobotSource

    RoundOf = Callable[[int], tuple[Robot, Mapping[str, Camera] | None]]
    """Returns the robot of a round, and its viewpoints if they are given."""

# Imports are inside the command, so that `gslts --help` starts fast.


def run(
    map_path: WritableMap,
    robot: Annotated[
        str | None,
        typer.Option(metavar="ROBOT", help="A simulated robot, such as day.json of gslts sim day."),
    ] = None,
    frames: Annotated[
        Path | None,
        typer.Option(metavar="DATASET", help="Recorded frames: one round, in their order."),
    ] = None,
    rounds: Annotated[
        int | None,
        typer.Option(min=1, help="Number of rounds; by default as many as the day has."),
    ] = None,
    iterations: Annotated[
        int, typer.Option(min=0, help="Maximum number of refinement steps.")
    ] = 250,
    localize: Localize = False,
    extend: Annotated[
        bool,
        typer.Option("--extend", help="After each round, also map space that the map lacks."),
    ] = False,
    share: Annotated[
        bool,
        typer.Option("--share", help="After each round, exchange versions with other robots."),
    ] = False,
    consolidate: Annotated[
        bool,
        typer.Option("--consolidate", help="After the last round, refine what has changed."),
    ] = False,
    view: Annotated[
        bool, typer.Option("--view", help="Also show the map in the browser, as gslts view does.")
    ] = False,
    control: Control = False,
    threads: Threads = 0,
) -> None:
    """Run rounds through a home, and keep its map up to date.

    Where a change is suspected, the robot observes again. A confirmed change becomes a version of
    the map (gslts log), or is deferred to a later round. Ctrl-C or SIGTERM stops after the present
    transaction; the same command continues there, also after a crash.

    With --extend, the robot looks around where no camera of the map ever saw, such as behind a door
    that is open now, and the map grows; a recording adds what it shows.

    With --share, versions of a map that was pushed or cloned are exchanged after each round, as
    gslts push does; without a network, the robot works on and tries again after the next round.

    With --view --control, whoever looks at the map in the browser can send the robot to an object,
    which it reaches between two viewpoints.

    With --consolidate, it ends with more views of all changes, as gslts consolidate does.

    Example: gslts run out/map --robot out/day/day.json --extend
    """
    from tqdm import tqdm

    from gslts.fleet.state import require_remote_state
    from gslts.keeper.describe import describe_keeper
    from gslts.keeper.errand import drive_to
    from gslts.keeper.keeper import MapKeeper, StoppedError
    from gslts.robots.localized import localized
    from gslts.robots.sources import open_robot
    from gslts.robots.watched import WatchedRobot
    from gslts.viewer.beside import viewer_beside

    require_view(view, control)
    if control and frames is not None:
        raise ValueError("--control: a recording cannot be driven; give --robot instead")
    if share:
        require_remote_state(map_path)
    if robot is not None and frames is None:
        opened, given = open_robot(robot), None
        round_of, available, source = _rounds_of_robot(opened), opened.rounds, opened.digest
    elif frames is not None and robot is None:
        localizer = localizer_of(map_path, threads) if localize else None
        recording, given = read_recording(frames, localizer, needs_poses=extend)
        round_of, available = _rounds_of_recording(recording), None
        source = str(frames.resolve())
    else:
        raise ValueError("give either --robot or --frames")
    # Frames of a recording are localized when they are read.
    config = _config(iterations, threads, relocalize=localize and robot is not None)
    with (
        stop_signals() as received,
        viewer_beside(map_path, view, control) as pages,
        tqdm(desc="starting", bar_format=BAR, disable=None) as bar,
    ):

        def on_progress(stage: str) -> None:
            left = len(keeper.state.remaining or ())
            bar.total = max(bar.total or 0, left)
            bar.n = bar.total - left
            bar.set_postfix_str(stage)

        def log(line: str) -> None:
            tqdm.write(line)
            sys.stdout.flush()  # A reader of the log sees a version as soon as it exists.

        with MapKeeper(
            map_path,
            config,
            should_stop=lambda: bool(received),
            progress=on_progress,
            log=log,
        ) as keeper:

            def in_map(driven: Robot) -> Robot:
                return WatchedRobot(
                    localized(driven, keeper.localizer),
                    lambda frame: pages.show(frame, lambda: describe_keeper(keeper)),
                )

            def follow_goal(robot: Robot) -> None:
                pages.follow_goal(
                    lambda goal: drive_to(keeper, robot, goal.words, goal.box).describe()
                )

            first = keeper.begin_source(source)
            last = first + (rounds or 1)
            if rounds is None and available is not None:
                last = max(first, available)
            try:
                for number in range(first, last):
                    bar.set_description(f"round {number}", refresh=False)
                    bar.reset(total=0)
                    driven, viewpoints = round_of(number)
                    shown = in_map(driven)
                    keeper.go_round(shown, viewpoints, partial(follow_goal, shown))
                    if extend and given is not None:
                        keeper.extend(given, str(frames))
                    elif extend:
                        keeper.explore(shown)
                    if share:
                        keeper.let_others_write(lambda: _exchange(map_path, log))
                if consolidate:
                    keeper.consolidate(in_map(round_of(max(first, last - 1))[0]))
            except StoppedError:
                raise RuntimeError(
                    f"stopped in round {keeper.state.round}; the same command continues there"
                ) from None
            version = keeper.version
    for change in keeper.state.deferred:
        typer.echo(change.describe())
    typer.echo(
        f"{last - first} round(s); {map_path} is version {version.number} now, "
        f"{len(keeper.state.deferred)} deferred; see gslts log {map_path}"
    )


def _exchange(map_path: Path, log: Callable[[str], None]) -> None:
    """Exchange versions with other robots; without a network, log why not."""
    from gslts.fleet.exchange import push_map

    try:
        done = push_map(map_path)
    except OSError as error:
        log(f"not shared: {error}")
        return
    for reason in done.given_up:
        log(f"given up: {reason}")
    log(f"shared version {done.version.number}: {done.pulled} pulled, {done.pushed} pushed")


@contextmanager
def stop_signals(on_signal: Callable[[], None] = lambda: None) -> Iterator[list[int]]:
    """Collect SIGINT and SIGTERM; a second one of the same kind ends the program.

    Args:
        on_signal: Called for each of them.

    Yields:
        Numbers of the signals received so far.
    """
    received: list[int] = []

    def note(number: int, _: object) -> None:
        received.append(number)
        on_signal()
        signal.signal(number, previous[number])

    previous: dict[int, Any] = {}
    for number in (int(signal.SIGINT), int(signal.SIGTERM)):
        previous[number] = signal.signal(number, note)
    try:
        yield received
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def _config(iterations: int, threads: int, *, relocalize: bool) -> KeeperConfig:
    from gslts.change.config import DetectionConfig
    from gslts.keeper.config import KeeperConfig
    from gslts.localization.config import RelocalizationConfig
    from gslts.mapping.config import PRESETS
    from gslts.update import RefineConfig, UpdateConfig

    return KeeperConfig(
        detection=DetectionConfig(threads=threads),
        update=UpdateConfig(refine=RefineConfig(iterations=iterations), threads=threads),
        extension=PRESETS["fast"].with_settings([f"threads={threads}"]),
        relocalization=RelocalizationConfig(threads=threads) if relocalize else None,
    )


def _rounds_of_robot(source: RobotSource) -> RoundOf:
    """Return the robot of each round, in a home with the changes up to that round."""
    return lambda number: (source.robot(number + 1), None)


def _rounds_of_recording(frames: Mapping[str, RgbdFrame]) -> RoundOf:
    """Return a robot that replays frames, and their cameras as viewpoints."""
    from gslts.robots.recorded import RecordedRobot

    robot = RecordedRobot(list(frames.values()))
    cameras = {name: frame.camera for name, frame in frames.items()}
    return lambda _: (robot, cameras)
