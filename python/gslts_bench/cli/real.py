"""The command `gslts bench real`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gslts.cli.jobs import NumberOfJobs, Scheduler
from gslts.cli.mapping import Preset
from gslts_bench.cli.options import HomeOptions, finish

# What a command needs is imported inside it, so that `gslts --help` answers at once.


def real(
    folder: Annotated[
        Path | None, typer.Argument(help="Folder with a folder per room, such as real_changes.")
    ] = None,
    dataset: Annotated[
        Path | None,
        typer.Option(
            help="Instead of visits, a data set of an unchanged room such as one of 7-Scenes: "
            "changes are made in its map, and unchanged frames must give no report."
        ),
    ] = None,
    updates: Annotated[
        bool,
        typer.Option(
            help="Instead of comparing frames, update the map visit after visit; one frame of each "
            "is held out."
        ),
    ] = False,
    without_depth: Annotated[
        bool, typer.Option(help="Compare the frames of later visits without their depth.")
    ] = False,
    images: Annotated[
        Path | None,
        typer.Option(
            help="New or empty folder for overlays of all visits or made changes, or for held-out "
            "frames beside the maps."
        ),
    ] = None,
    json_path: Annotated[
        Path | None, typer.Option("--json", help="File for the complete result.")
    ] = None,
    work: Annotated[
        Path, typer.Option(help="Folder of maps and results, which are reused.")
    ] = Path("out/bench"),
    preset: Annotated[Preset, typer.Option(help="Preset of the mapping.")] = Preset.FAST,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Mapping setting, as for gslts map."),
    ] = None,
    jobs: NumberOfJobs = None,
    scheduler: Scheduler = None,
) -> None:
    """Measure change detection in real rooms: on visits with changes, or in one recorded room.

    With FOLDER, a map is made from the first visit of each room, and the frames of the later visits
    are compared with it against boxes of what changed: one by one, and all of a visit together. The
    visits are those of the Object Change Detection data of TU Wien, as the repository
    CYWS3D-pipeline has them: Kitchen, Office and SmallRoom, each with scene1 to scene6.

    With --dataset, two maps are made, each from every second frame, and compared with the others.
    Objects are taken out, copied or moved in the map, so that the frames show an addition, a
    removal or a relocation. Against the unchanged map, each report is false: in single frames at
    given and at localized poses, and in the sequence through the monitor.

    Example: gslts bench real real_changes --images out/real --json out/real.json

    Example: gslts bench real --dataset 7scenes --json out/real_room.json
    """
    if (folder is None) == (dataset is None):
        raise ValueError("bench real: expected a FOLDER of visits or --dataset, one of them")
    if updates and folder is None:
        raise ValueError("bench real: --updates needs a FOLDER of visits")
    if without_depth and (updates or folder is None):
        raise ValueError("bench real: --without-depth needs a FOLDER of visits, and no --updates")
    options = HomeOptions(
        json_path=json_path,
        work=work,
        preset=preset,
        settings=settings,
        jobs=jobs,
        scheduler=scheduler,
    )
    options.prepare(images)
    if dataset is not None:
        _compare_room(options, dataset, images)
        return
    from gslts_bench.real import tables, update_tables
    from gslts_bench.real.run import VisitUnit
    from gslts_bench.real.updates import UpdateUnit
    from gslts_bench.real.visits import rooms_in

    assert folder is not None
    rooms = rooms_in(folder, options.setup.mapping, work)
    if updates:
        changing = [UpdateUnit(room, images) for room in rooms]
        finish(options.run(update_tables.BENCHMARK, changing, on_homes=False).errors)
    else:
        seeing = [VisitUnit(room, images, without_depth) for room in rooms]
        finish(options.run(tables.BENCHMARK, seeing, on_homes=False).errors)


def _compare_room(options: HomeOptions, path: Path, images: Path | None) -> None:
    """Measure change detection in a recorded room."""
    from gslts_bench.real.room_run import units_of
    from gslts_bench.real.room_tables import BENCHMARK
    from gslts_bench.relocalization.room import RecordedRoom

    units = units_of(RecordedRoom.of(path, options.setup.mapping, options.work), images)
    finish(options.run(BENCHMARK, units, on_homes=False).errors)
