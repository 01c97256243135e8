"""Precision and recall of the object events that `gslts log` tells, over 30 simulated days.

    python benchmarks/objects_benchmark.py                          # two homes for development
    python benchmarks/objects_benchmark.py --homes living_room_7 --changes 12
    python benchmarks/objects_benchmark.py --homes bookstore.glb --changes 13   # foreign, ten days

A robot goes one round a day through a home in which objects come, go and move, and keeps the map.
What its history tells, move by move, is compared with what happened, and the versions are counted
that show something that did not. Folders with a complete series are only scored again.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from tqdm import tqdm

from gslts.datasets import open_dataset
from gslts.io.atomic_files import empty_folder, write_atomic
from gslts.keeper.config import KeeperConfig
from gslts.keeper.keeper import MapKeeper
from gslts.mapping.config import PRESETS
from gslts.mapping.engine import make_map
from gslts.mapping.report.summary import write_result
from gslts.semantics.add_semantics import add_semantics
from gslts.store.history import open_history
from gslts.store.records import Event
from gslts.update.config import RefineConfig, UpdateConfig
from gslts_bench.series.events import is_untrue, score_events, true_events, was_found
from gslts_sim.capture import capture
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.day import make_day, read_day
from gslts_sim.explore import explore
from gslts_sim.home_source import FileSource, HomeSource
from gslts_sim.task import Change

FRAMES, ITERATIONS, MAPPING_S = 120, 100, 30.0
"""Maximum number of frames of the recording, iterations of a refinement, and time of mapping, s."""
DAY, MAP = "day.json", "map"
"""Names in the folder of a series."""
Kind = TypeVar("Kind", Event, Change)


def run_series(folder: Path, name: str, changes: int, size: tuple[int, int]) -> None:
    """Map a home, and keep the map over all rounds.

    Args:
        folder: New or empty folder; gets the true changes and the map.
        name: Room type and seed, such as kitchen_3, or the path of a GLB file.
        changes: Number of changes.
        size: Width and height of the images, px.
    """
    empty_folder(folder)
    width, height = size
    settings = TaskSettings(width=width, height=height)
    if name.endswith(".glb"):
        file, home = FileSource.of_path(Path(name), folder)
        day = make_day(file, home, settings, 0, changes)
    else:
        room, seed = name.rsplit("_", 1)
        source, coarse = HomeSource.of_seed(room, int(seed))
        day = make_day(source, coarse, settings, int(seed), changes)
        home = source.load(folder)
    robot = day.robot(home, 0)
    capture(robot, explore(robot.home, FRAMES)[0], folder / "before")
    config = PRESETS["fast"].model_copy(update={"budget_s": MAPPING_S, "threads": 1})
    write_result(folder / MAP, make_map(open_dataset(folder / "before"), config), "before")
    add_semantics(folder / MAP, folder / "before", threads=1)
    update = UpdateConfig(threads=1, refine=RefineConfig(iterations=ITERATIONS))
    with MapKeeper(folder / MAP, KeeperConfig(update=update)) as keeper:
        for number in tqdm(range(1, len(day.rounds) + 1), desc=folder.name):
            keeper.go_round(day.robot(home, number))
    write_atomic(folder / DAY, (day.model_dump_json(indent=1) + "\n").encode())


def summary(folder: Path) -> tuple[list[str], str]:
    """Return rows of the markdown table of events that a series tells, and of that of versions.

    Args:
        folder: Of a series that is complete.
    """
    day = read_day(folder / DAY)
    changes = [event.change for happened in day.rounds for event in happened]
    true = true_events(changes)
    with open_history(folder / MAP) as store:
        found: list[Event] = store.events()
        reported = [event for track in store.tracks() for event in track.events]
    possible = [change for change in true if was_found(change, found)]
    rows = []
    for name, events in (("as updates found them", found), ("as tracks tell them", reported)):
        recall_of_found = _cells(events, possible)[1]
        cells = (*_cells(events, true), recall_of_found, *_cells(_moves(events), _moves(true)))
        rows.append(f"| {folder.name} | {len(day.rounds)} | {name} | {' | '.join(cells)} |")
    return rows, f"| {folder.name} | {len(day.rounds)} | {' | '.join(_versions(found, changes))} |"


def _versions(found: Sequence[Event], changes: Sequence[Change]) -> tuple[str, str, str]:
    """Count versions, those with an untrue event, and changes that a version shows."""
    versions = {event.version for event in found}
    untrue = {event.version for event in found if is_untrue(event, changes)}
    shown = sum(was_found(change, found) for change in changes)
    return str(len(versions)), str(len(untrue)), f"{shown} of {len(changes)}"


def _cells(events: Sequence[Event], true: Sequence[Change]) -> tuple[str, str]:
    score = score_events(events, true)
    return (
        f"{score.right} of {score.reported} ({score.precision:.2f})",
        f"{score.right} of {score.true} ({score.recall:.2f})",
    )


def _moves(events: Sequence[Kind]) -> list[Kind]:
    return [event for event in events if event.kind == "relocation"]


def main() -> None:
    """Run the series that are missing, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--homes", nargs="+", default=["bedroom_3", "living_room_8"])
    parser.add_argument("--changes", type=int, default=40, help="in each home: 40 are 30 days")
    parser.add_argument("--size", default="640x480", help="WxH of the images, px")
    parser.add_argument("--work", type=Path, default=Path("out/objects"))
    given = parser.parse_args()
    width, height = map(int, given.size.split("x"))
    rows, versions = [], []
    for name in given.homes:
        folder = given.work / f"{Path(name).name}_{given.changes}_{given.size}"
        if not (folder / DAY).exists():
            run_series(folder, name, given.changes, (width, height))
        events, version = summary(folder)
        rows += events
        versions.append(version)
    print(
        "| home | days | events | precision | recall | recall of what updates found "
        "| precision of moves | recall of moves |\n"
        "| --- | --: | --- | --: | --: | --: | --: | --: |"
    )
    print("\n".join(rows))
    print(
        "\n| home | days | versions | with something untrue | changes shown |\n"
        "| --- | --: | --: | --: | --: |"
    )
    print("\n".join(versions))


if __name__ == "__main__":
    main()
