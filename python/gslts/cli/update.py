"""The command `gslts update`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.mapping import BAR, Map, Threads

if TYPE_CHECKING:
    from gslts.change.changes import Change
    from gslts.change.detect import ChangeDetector
    from gslts.robot import Robot
    from gslts.update.updater import Record

# What a command needs is imported inside it, so that `gslts --help` answers at once.

STAYS = ("dataset", "origin", "config", "lenses")
"""Of a manifest; the rest tells of the frames that the map was made of and judged by."""


def update(
    map_path: Map,
    out: Annotated[Path, typer.Option(help="Folder of the new map; must not be there yet.")],
    robot: Annotated[
        Path | None,
        typer.Option(
            metavar="TASK", help="A scene change task: the simulated robot looks after the change."
        ),
    ] = None,
    frames: Annotated[
        Path | None,
        typer.Option(metavar="DATASET", help="Recorded frames, taken after the change."),
    ] = None,
    iterations: Annotated[int, typer.Option(min=0, help="Of the refinement, at most.")] = 250,
    literal: Annotated[
        bool, typer.Option("--literal", help="Edit as printed in GS-LTS, without improvements.")
    ] = False,
    threads: Threads = 0,
) -> None:
    """Look closer at what changed, edit the map there, and refine only that.

    The new map's folder also holds update.json, which tells what was done, and update.png, what was
    seen and the map before and after. An update that does not fit views kept aside better is
    refused: there is no new map then, and OUT.refused.json tells why.

    Example: gslts update out/map --robot out/tasks/0000_removal_Mug-1.json --out out/map_2
    """
    from PIL import Image
    from tqdm import tqdm

    from gslts import __version__
    from gslts.camera_files import read_cameras
    from gslts.change.config import DetectionConfig
    from gslts.change.detect import ChangeDetector
    from gslts.files import write_whole
    from gslts.map_folder import CAMERAS, read_map, read_map_folder, write_map_folder
    from gslts.update.config import LITERAL, UpdateConfig
    from gslts.update.picture import update_picture
    from gslts.update.updater import update as run

    if (robot is None) == (frames is None):
        raise ValueError("give either --robot or --frames")
    refused = out.with_name(f"{out.name}.refused.json")
    for path in (out, refused):
        if path.exists():
            raise FileExistsError(f"{path} is there already")
    is_folder = map_path.is_dir()
    gaussian_map, manifest = read_map_folder(map_path) if is_folder else (read_map(map_path), {})
    cameras = read_cameras(map_path / CAMERAS) if is_folder else {}
    detector = ChangeDetector(
        gaussian_map, DetectionConfig(threads=threads), cameras=cameras.values()
    )
    if robot is not None:
        scout = _simulated(robot)
        changes = list(detector.detect(scout.observe()).changes)
    else:
        assert frames is not None  # One of them is given.
        scout, changes = _recorded(frames, detector)
    for change in changes:
        x, y, z = change.point
        typer.echo(f"{change.kind} at ({x:.2f}, {y:.2f}, {z:.2f}) m, {change.confidence:.2f}")
    config = UpdateConfig(threads=threads)
    refine = config.refine.model_copy(update={"iterations": iterations})
    config = config.model_copy(update={"refine": refine})
    if literal:
        config = config.model_copy(update={"edit": LITERAL})
    steps = config.refine.iterations + len(changes) * (config.collect.steps + 1)
    with tqdm(total=steps, desc="updating", bar_format=BAR, disable=None) as bar:

        def tell(stage: str) -> None:
            bar.set_description(stage, refresh=False)
            bar.update()

        result = run(
            gaussian_map,
            list(cameras.values()),
            changes,
            scout,
            config,
            detector=detector,
            tell=tell,
        )
    record = json.dumps(result.record.plain(), indent=1) + "\n"
    if result.record.refused is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        write_whole(refused, record.encode())
        raise RuntimeError(f"{map_path} stays as it is: {result.record.refused}; see {refused}")
    seen = {f"update {k}": view.camera for k, view in enumerate(result.views, len(cameras))}
    picture = update_picture(gaussian_map, result.gaussian_map, result.views, threads)

    def finish(folder: Path) -> None:
        (folder / "update.json").write_text(record, encoding="utf-8")
        Image.fromarray(picture).save(folder / "update.png")

    told = {name: manifest[name] for name in STAYS if name in manifest}
    told |= {"gslts": __version__, "updated_from": str(map_path)}
    write_map_folder(out, result.gaussian_map, told, {**cameras, **seen}, finish)
    typer.echo(_words(result.record, gaussian_map.size))
    typer.echo(f"wrote {out}: {result.gaussian_map.size} Gaussians")


def _simulated(path: Path) -> Robot:
    from gslts.sim.task import read_task

    task = read_task(path)
    return task.start(task.home.load(path.parent), changed=True)


def _recorded(path: Path, detector: ChangeDetector) -> tuple[Robot, list[Change]]:
    """A robot that replays frames, and the changes that enough of them show."""
    from tqdm import tqdm

    from gslts.change.monitor import confirmed
    from gslts.datasets import open_dataset
    from gslts.recorded_robot import RecordedRobot

    opened = open_dataset(path)
    frames = [one.read() for one in tqdm(opened.frames, desc="reading", disable=None)]
    return RecordedRobot(frames), confirmed(detector, frames)[0]


def _words(record: Record, size: int) -> str:
    used, held_back = record.views
    seconds = ", ".join(f"{name} {value:.1f} s" for name, value in record.seconds.items())
    return (
        f"{used} views used, {held_back} held back, {len(record.skipped)} skipped\n"
        f"of {size} Gaussians {record.removed} removed and {record.moved} refined in "
        f"{record.iterations} steps; {record.added} are new\n"
        f"views held back, around the change: {record.psnr_before_db:.2f} dB before, "
        f"{record.psnr_after_db:.2f} dB after\n{seconds}"
    )
