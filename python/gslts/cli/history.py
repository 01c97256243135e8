"""Commands for the versions of a map: log, show, diff, restore, verify, gc, import."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.arguments import Folder, MapFolder, WritableMap
from gslts.cli.mapping import BAR, Threads

if TYPE_CHECKING:
    from gslts.store.causes import Record
    from gslts.store.delta import Delta
    from gslts.store.history import History
    from gslts.store.records import Rejection, Version

# Imports are inside the commands, so that `gslts --help` starts fast.

Number = Annotated[int, typer.Argument(min=1, help="Number of a version, from gslts log.")]


def log(
    map_path: MapFolder,
    name: Annotated[
        str | None,
        typer.Option("--object", metavar="NAME", help='History of one object, such as "Pillow 2".'),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    html: Annotated[
        Path | None, typer.Option(help="Write the whole history with images to this page.")
    ] = None,
) -> None:
    """List the versions of a map, newest first, with their robots, object changes and rejections.

    Each change of an object is listed once: a move whose ends two versions show, in the later one.
    Commands that read one version take an old one as MAP@NUMBER, such as out/map@2.

    Example: gslts log out/map
    """
    from gslts.store.history import open_history

    if html is not None and (as_json or name is not None):
        raise ValueError("--html writes the whole history: give it without --object and --json")
    with open_history(map_path) as store:
        if html is not None:
            from gslts.store.history_page import write_history

            write_history(html, store)
            typer.echo(f"wrote {html}")
        elif as_json:
            typer.echo(_history_json(store, name))
        elif name is not None:
            _print_track(store, name)
        else:
            _print_history(store)


def show(map_path: MapFolder, number: Number) -> None:
    """Show the record of a version: its cause, settings, timings and counts.

    Example: gslts show out/map 2
    """
    from gslts.store.describe import describe_versions
    from gslts.store.history import open_history
    from gslts.store.manifest import update_image_path

    with open_history(map_path) as store:
        version, lines = store.version(number), describe_versions(store)
    typer.echo(_version_line(version))
    for line in lines[number]:
        typer.echo(f"        {line}")
    image = update_image_path(map_path, number)
    if image.exists():
        typer.echo(f"        image: {image}")
    typer.echo(version.cause.model_dump_json(indent=1))


def diff(
    map_path: MapFolder,
    before: Number,
    after: Number,
    out: Annotated[
        Path | None, typer.Option(help="PNG: both versions from where they differ most.")
    ] = None,
    threads: Threads = 0,
) -> None:
    """Compare two versions: Gaussians, object changes, and an image.

    Example: gslts diff out/map 1 3 --out out/diff.png
    """
    from gslts.io.image_files import write_image
    from gslts.store.camera_files import cameras_of_map
    from gslts.store.delta import compare_by_ids
    from gslts.store.describe import describe_event
    from gslts.store.map_folder import open_map
    from gslts.update.report_image import draw_difference

    with open_map(map_path) as store:
        maps = store.read(before), store.read(after)
        only_after, only_before = store.changes_between(before, after)
    typer.echo(_describe_delta(compare_by_ids(*maps)))
    for track, event in only_after:
        typer.echo(f"version {event.version}: {describe_event(event, track.name)}")
    for track, event in reversed(only_before):
        typer.echo(f"without version {event.version}: {describe_event(event, track.name)}")
    if out is not None:
        image = draw_difference(*maps, list(cameras_of_map(map_path).values()), threads)
        out.parent.mkdir(parents=True, exist_ok=True)
        write_image(out, image)
        typer.echo(f"wrote {out}")


def restore(map_path: WritableMap, number: Number) -> None:
    """Make an old version the newest one again; later versions stay in the history.

    Example: gslts restore out/map 2
    """
    from gslts.store.map_folder import open_map

    with open_map(map_path, writable=True) as store:
        version = store.restore(number)
    typer.echo(_version_line(version))


def verify(map_path: MapFolder) -> None:
    """Check every file of every version against its checksum, with landmarks and semantics.

    Example: gslts verify out/map
    """
    from tqdm import tqdm

    from gslts.localization.landmark_files import LANDMARK_FILES, read_landmark_file
    from gslts.semantics.files import semantics_problems
    from gslts.store.map_folder import open_map
    from gslts.store.measurement_files import MEASUREMENT_FILES, read_measurement_file

    with open_map(map_path) as store:
        versions = store.versions()
        with tqdm(total=len(versions), desc="checking", bar_format=BAR, disable=None) as bar:
            problems = store.find_problems(bar.update)
        problems += LANDMARK_FILES.find_problems(store, read_landmark_file)
        problems += MEASUREMENT_FILES.find_problems(store, read_measurement_file)
        problems += semantics_problems(store)
    for problem in problems:
        typer.echo(problem, err=True)
    if problems:
        raise RuntimeError(f"{map_path}: {len(problems)} problem(s), named above")
    typer.echo(
        "1 version is intact" if len(versions) == 1 else f"{len(versions)} versions are intact"
    )


def gc(
    map_path: Folder,
    keep: Annotated[
        int | None,
        typer.Option(min=1, help="Remove the Gaussians of all but this many newest versions."),
    ] = None,
) -> None:
    """Remove files that no version needs, and old versions on request; the log stays complete.

    Of a shared map, versions that were not pushed stay, with the last one before them.

    Example: gslts gc out/map --keep 100
    """
    from gslts.fleet.state import read_remote_state
    from gslts.localization.landmark_files import LANDMARK_FILES
    from gslts.store.map_folder import open_map
    from gslts.store.measurement_files import MEASUREMENT_FILES

    with open_map(map_path, writable=True) as store:
        shared = read_remote_state(map_path)
        if keep is not None and shared is not None:
            keep = max(keep, store.version().number - shared.number + 1)
        freed = store.collect_garbage() if keep is None else store.compact(keep)
        freed += sum(files.remove_unneeded(store) for files in (LANDMARK_FILES, MEASUREMENT_FILES))
    typer.echo(f"{freed} bytes freed")


def import_map(
    file: Annotated[Path, typer.Argument(help="A .ply, .glb or .spz file of any 3DGS program.")],
    out: Annotated[Path, typer.Option(help="New folder of the map.")],
) -> None:
    """Make a map with versions from a file of Gaussians.

    Example: gslts import point_cloud.ply --out out/map
    """
    from gslts.io.map_files import read_map_file
    from gslts.store.causes import ImportCause
    from gslts.store.map_folder import write_map_folder

    gaussian_map = read_map_file(file)
    cause = ImportCause(file=file.name)
    write_map_folder(out, gaussian_map, {"dataset": file.name}, {}, cause=cause)
    typer.echo(f"wrote {out}: {gaussian_map.size} Gaussians")


def _history_json(store: History, name: str | None) -> str:
    if name is not None:
        return store.track(name).model_dump_json(indent=1)
    records: dict[str, Sequence[Record]] = {
        "versions": store.versions(),
        "events": store.events(),
        "tracks": store.tracks(),
        "rejections": store.rejections(),
    }
    content = {
        name: [record.model_dump(mode="json") for record in part] for name, part in records.items()
    }
    return json.dumps(content, indent=1)


def _print_history(store: History) -> None:
    from gslts.store.describe import describe_rejection, describe_versions

    versions = store.versions()  # First: another command may add versions meanwhile.
    lines, rejections = describe_versions(store), store.rejections()
    for version in reversed(versions):
        for rejection in rejections:
            if rejection.version == version.number:
                typer.echo(_line("", rejection, describe_rejection(rejection)))
        typer.echo(_version_line(version))
        for line in lines[version.number]:
            typer.echo(f"        {line}")


def _print_track(store: History, name: str) -> None:
    from gslts.store.describe import describe_event

    track = store.track(name)
    for event in reversed(track.events):
        version, text = store.version(event.version), describe_event(event, track.name)
        typer.echo(_line(version.number, version, text))


def _version_line(version: Version) -> str:
    from gslts.store.describe import describe_version

    return _line(version.number, version, describe_version(version))


def _line(number: int | str, record: Version | Rejection, text: str) -> str:
    from gslts.store.describe import format_made

    return f"{number:6}  {format_made(record)}  {text}"


def _describe_delta(delta: Delta) -> str:
    return (
        f"{len(delta.removed)} Gaussians removed, {delta.added.size} added, "
        f"{delta.changed.size} changed"
    )
