"""Commands of `gslts sim`: simulated homes, recordings of them, and scene change tasks."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from gslts_sim.cli.arguments import Height, Noise, Seed, Source, Width
from gslts_sim.cli.ros import ros

# Imports are inside the commands, so that `gslts --help` answers at once.

sim = typer.Typer(no_args_is_help=True, help="Simulated homes.")
sim.command()(ros)


@sim.command()
def home(source: Source, seed: Seed = 0) -> None:
    """List the objects of a home: id, position, size, receptacle, and whether it is movable.

    Example: gslts sim home kitchen 3
    """
    from gslts_sim.home_source import open_home

    for obj in open_home(source, seed).objects:
        low, high = obj.box_in_world
        position = " ".join(f"{value:6.2f}" for value in (*((low + high) / 2)[:2], low[2]))
        size = " x ".join(f"{value:.2f}" for value in high - low)
        typer.echo(
            f"{_printable(obj.id):20} at {position} m  size {size} m  "
            f"on {_printable(obj.parent or '-'):16} "
            f"{'movable' if obj.movable else ''}".rstrip()
        )


@sim.command()
def show(
    source: Annotated[
        str,
        typer.Argument(
            help="kitchen, living_room or bedroom, a .glb or .gltf file, or the .json of a task."
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder for the images.")],
    seeds: Annotated[
        list[int] | None, typer.Argument(min=0, help="Seeds of homes; one image each.")
    ] = None,
) -> None:
    """Draw homes (views from the corners and a labelled plan) or a task (before and after).

    Example: gslts sim show living_room 0 1 2 --out out/homes
    """
    from tqdm import tqdm

    from gslts_sim.contact_sheet import write_contact_sheet
    from gslts_sim.home_source import FILE_TYPES, open_home
    from gslts_sim.task import read_task
    from gslts_sim.task_sheet import write_task_sheet

    path = Path(source)
    if path.suffix.lower() in (".json", *FILE_TYPES) and seeds:
        raise ValueError(f"{source} holds one home: give no seeds")
    if path.suffix.lower() == ".json":
        task = read_task(path)
        home = task.home.load(path.parent)
        task.states(home)
        out.mkdir(parents=True, exist_ok=True)
        write_task_sheet(task, home, out / f"{path.stem}.png")
        typer.echo(f"wrote {out / path.stem}.png")
        return
    for seed in tqdm(seeds or [0], desc=path.name, unit="home", disable=None):
        home = open_home(source, seed)
        out.mkdir(parents=True, exist_ok=True)
        is_file = path.suffix.lower() in FILE_TYPES
        write_contact_sheet(home, out / f"{path.stem if is_file else f'{source}_{seed}'}.png")
    typer.echo(f"wrote {len(seeds or [0])} image(s) to {out}")


@sim.command()
def capture(
    source: Source,
    out: Annotated[Path, typer.Option(help="Folder of the data set; new or empty.")],
    seed: Seed = 0,
    frames: Annotated[int, typer.Option(min=1, help="Maximum number.")] = 200,
    noise: Noise = "kinect",
    visit: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    width: Width = 640,
    height: Height = 480,
    rooms: Annotated[
        list[str] | None,
        typer.Option(
            "--in", metavar="ROOM", help="Record only from this room of a flat; may be repeated."
        ),
    ] = None,
) -> None:
    """Record all of a home with the robot's camera: RGB-D frames in nerfstudio's layout.

    Example: gslts sim capture kitchen 3 --out out/kitchen_3

    Example: gslts sim capture flat 3 --in hall --in kitchen --out out/first_visit
    """
    from tqdm import tqdm

    from gslts.io.atomic_files import empty_folder
    from gslts_sim.capture import capture as write
    from gslts_sim.controller import Controller
    from gslts_sim.explore import explore, viewpoints_in
    from gslts_sim.home_source import open_home

    home = open_home(source, seed)
    viewpoints_in(home, rooms or (), [])  # Reject an unknown room before the long search.
    robot = Controller(home, width=width, height=height, noise=noise, seed=visit)
    empty_folder(out)
    viewpoints, share = explore(home, frames, _exploring)
    if rooms:
        viewpoints = viewpoints_in(home, rooms, viewpoints)
    count = write(robot, tqdm(viewpoints, desc=home.name, unit="frame", disable=None), out)
    typer.echo(
        f"wrote {count} frames to {out}: {100 * share:.0f} % of the views that the surfaces need"
    )


@sim.command()
def tasks(
    out: Annotated[Path, typer.Option(help="Folder for the scripts; new or empty.")],
    sources: Annotated[
        list[str] | None,
        typer.Argument(help="Room types or .glb files; all room types if none is given."),
    ] = None,
    count: Annotated[int, typer.Option(min=1, help="Number of tasks.")] = 600,
    per_home: Annotated[int, typer.Option(min=1, help="Maximum number of tasks per home.")] = 12,
    first_seed: Annotated[
        int, typer.Option(min=0, help="Seed of the first home; 10000 and above are test homes.")
    ] = 0,
    noise: Noise = "kinect",
    object_id: Annotated[
        str | None, typer.Option("--object", help="The only object to remove or relocate.")
    ] = None,
    receptacle_id: Annotated[
        str | None, typer.Option("--on", help="The only receptacle to put it on.")
    ] = None,
) -> None:
    """Write scene change tasks (additions, removals and relocations), one JSON script each.

    Example: gslts sim tasks --count 600 --out out/tasks
    """
    from itertools import chain

    from tqdm import tqdm

    from gslts.io.atomic_files import empty_folder
    from gslts_sim import ROOM_TYPES
    from gslts_sim.change_sampler import TaskSettings
    from gslts_sim.task import write_task
    from gslts_sim.tasks import TaskMaker, generate_tasks, script_name

    settings = TaskSettings(noise=noise, object_id=object_id, receptacle_id=receptacle_id)
    maker = TaskMaker(settings, first_seed)
    names = sources or list(ROOM_TYPES)
    generated = generate_tasks(names, out, first_seed, count, per_home, maker)
    # Errors of the options show before anything is written.
    first = next(generated, None)
    empty_folder(out)
    written = 0
    with tqdm(total=count, desc="tasks", unit="task") as bar:
        for task in chain([] if first is None else [first], generated):
            write_task(task, out / script_name(written, task))
            written += 1
            bar.update()
    reasons = ", ".join(f"{reason} ({times})" for reason, times in maker.rejected.most_common(8))
    typer.echo(f"wrote {written} tasks to {out}; rejected changes: {reasons or 'none'}")
    if written < count:
        why = reasons or "no other object can be added, removed or relocated"
        raise ValueError(f"only {written} of {count} tasks could be made: {why}")


@sim.command()
def day(
    source: Source,
    out: Annotated[Path, typer.Option(help="Folder for the day; new or empty.")],
    seed: Seed = 0,
    changes: Annotated[int, typer.Option(min=1, help="Number of changes.")] = 6,
    frames: Annotated[int, typer.Option(min=1, help="Maximum number of frames.")] = 150,
    noise: Noise = "kinect",
    width: Width = 640,
    height: Height = 480,
) -> None:
    """Write the changes of a home in a day (day.json), and record its state before (before/).

    Example: gslts sim day living_room 4 --out out/day
    """
    from tqdm import tqdm

    from gslts.io.atomic_files import empty_folder, write_atomic
    from gslts_sim.capture import capture as write
    from gslts_sim.change_sampler import TaskSettings
    from gslts_sim.day import make_day
    from gslts_sim.explore import explore
    from gslts_sim.tasks import homes_of

    settings = TaskSettings(noise=noise, width=width, height=height)
    origin, template = next(homes_of([source], out, seed))
    sampled = make_day(origin, template, settings, seed, changes)
    empty_folder(out)
    robot = sampled.robot(sampled.home.load(out), 0)
    viewpoints, _ = explore(robot.home, frames, _exploring)
    count = write(
        robot, tqdm(viewpoints, desc="before", unit="frame", disable=None), out / "before"
    )
    write_atomic(out / "day.json", (sampled.model_dump_json(indent=1) + "\n").encode())
    for number, events in enumerate(sampled.rounds):
        for event in events:
            typer.echo(f"before round {number}: {event.change.kind} of {event.change.object_id}")
    typer.echo(f"wrote {out / 'day.json'} and {count} frames to {out / 'before'}")


def _exploring(positions: list[Any]) -> Iterable[Any]:
    """Show a progress bar over the positions that a planner examines."""
    from tqdm import tqdm

    bar: Iterable[Any] = tqdm(positions, desc="exploring", unit="position", disable=None)
    return bar


def _printable(text: str) -> str:
    """Return a name from a file without control characters of terminals."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


@sim.command()
def replay(
    script: Annotated[Path, typer.Argument(metavar="TASK", help="Script of a scene change task.")],
    out: Annotated[Path, typer.Option(help="Folder of the data set; new or empty.")],
    changed: Annotated[bool, typer.Option("--changed", help="Record after the change.")] = False,
    frames: Annotated[int, typer.Option(min=1, help="Maximum number.")] = 200,
) -> None:
    """Record the home of a task: all of it before the change, or the viewpoints of the task after.

    The first of these is the one from which the robot first sees the change.

    Example: gslts sim replay out/tasks/0000_removal_Mug-1.json --changed --out out/after
    """
    from tqdm import tqdm

    from gslts.io.atomic_files import empty_folder
    from gslts_sim.capture import capture as write
    from gslts_sim.explore import explore
    from gslts_sim.task import read_task

    task = read_task(script)
    robot = task.start(task.home.load(script.parent), changed=changed)
    empty_folder(out)
    if changed:
        sets = task.test_viewpoints
        viewpoints = [task.viewpoint, *sets.near, *sets.far][:frames]
    else:
        viewpoints, _ = explore(robot.home, frames, _exploring)
    count = write(robot, tqdm(viewpoints, desc=script.stem, unit="frame", disable=None), out)
    typer.echo(f"wrote {count} frames to {out}")
