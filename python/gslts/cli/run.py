"""The command `gslts run`."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gslts.cli.localize import Localize, localizer_of, read_frames
from gslts.cli.mapping import BAR, Threads

if TYPE_CHECKING:
    from gslts.core.camera import Camera
    from gslts.core.robot import Robot
    from gslts.localization.localizer import Localizer
    from gslts.robots.sources import RobotSource

    Walk = Callable[[int], tuple[Robot, Mapping[str, Camera] | None]]
    """The robot of a round, and from where it is to look if that is known."""

# What a command needs is imported inside it, so that `gslts --help` answers at once.


def run(
    map_path: Annotated[Path, typer.Argument(metavar="MAP", help="Folder of a map.")],
    robot: Annotated[
        str | None,
        typer.Option(metavar="ROBOT", help="A simulated robot: day.json of gslts sim day."),
    ] = None,
    frames: Annotated[
        Path | None,
        typer.Option(metavar="DATASET", help="Recorded frames: one round, in their order."),
    ] = None,
    rounds: Annotated[
        int | None, typer.Option(min=1, help="How many; as many as the day has, if not given.")
    ] = None,
    iterations: Annotated[int, typer.Option(min=0, help="Of a refinement, at most.")] = 250,
    localize: Localize = False,
    threads: Threads = 0,
) -> None:
    """Go rounds through a home, and keep its map up to date.

    Where something looks changed, the robot looks again; what is certain is looked at closely and
    becomes a version of the map (gslts log), or is deferred to a later round. Ctrl-C or SIGTERM
    stops at the next safe point; the same command goes on there, also after a crash.

    Example: gslts run out/map --robot out/day/day.json
    """
    from tqdm import tqdm

    from gslts.change.config import DetectionConfig
    from gslts.keeper.keeper import LoopConfig, MapKeeper, StoppedError
    from gslts.localization.config import RelocalizationConfig
    from gslts.robots.sources import open_robot
    from gslts.update.config import UpdateConfig

    if robot is not None and frames is None:
        opened = open_robot(robot)
        walk, most, source = _of_a_robot(opened), opened.rounds, opened.digest
    elif frames is not None and robot is None:
        localizer = localizer_of(map_path, threads) if localize else None
        walk, most = _of_a_recording(frames, localizer), None
        source = str(frames.resolve())
    else:
        raise ValueError("give either --robot or --frames")
    update = UpdateConfig(threads=threads)
    refine = update.refine.model_copy(update={"iterations": iterations})
    config = LoopConfig(
        detection=DetectionConfig(threads=threads),
        update=update.model_copy(update={"refine": refine}),
        # Frames of a recording are where they were found already.
        localize=RelocalizationConfig(threads=threads) if localize and robot is not None else None,
    )
    with stopped_by_signals() as came, tqdm(desc="starting", bar_format=BAR, disable=None) as bar:

        def tell(stage: str) -> None:
            left = len(keeper.state.left or ())
            bar.total = max(bar.total or 0, left)
            bar.n = bar.total - left
            bar.set_postfix_str(stage)

        def say(words: str) -> None:
            tqdm.write(words)
            sys.stdout.flush()  # What a log tells must have happened, and the other way round.

        with MapKeeper(map_path, config, stopping=lambda: bool(came), tell=tell, say=say) as keeper:
            first = keeper.rounds_of(source)
            last = first + (rounds or 1) if rounds or most is None else max(first, most)
            try:
                for number in range(first, last):
                    bar.set_description(f"round {number}", refresh=False)
                    bar.reset(total=0)
                    keeper.go_round(*walk(number))
            except StoppedError:
                raise RuntimeError(
                    f"stopped in round {keeper.state.round}; the same command goes on there"
                ) from None
            version = keeper.version
    deferred = keeper.state.deferred
    for one in deferred:
        x, y, z = one.point
        typer.echo(f"deferred: {one.kind} at ({x:.2f}, {y:.2f}, {z:.2f}) m: {one.reason}")
    typer.echo(
        f"{last - first} round(s); {map_path} is version {version.number} now, {len(deferred)} "
        f"deferred; see gslts log {map_path}"
    )


@contextmanager
def stopped_by_signals() -> Iterator[list[int]]:
    """Collects SIGINT and SIGTERM; each ends the program only if it comes a second time."""
    came: list[int] = []

    def note(number: int, _: object) -> None:
        came.append(number)
        signal.signal(number, before[number])

    before: dict[int, Any] = {}
    for number in (int(signal.SIGINT), int(signal.SIGTERM)):
        before[number] = signal.signal(number, note)
    try:
        yield came
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _of_a_robot(source: RobotSource) -> Walk:
    """The robot of each round, which meets the changes up to that round."""
    return lambda number: (source.robot(number + 1), None)


def _of_a_recording(path: Path, localizer: Localizer | None) -> Walk:
    """A robot that replays frames, from where they were taken."""
    from gslts.robots.recorded import RecordedRobot

    read = read_frames(path, localizer)
    robot = RecordedRobot(list(read.values()))
    cameras = {name: frame.camera for name, frame in read.items()}
    return lambda _: (robot, cameras)
