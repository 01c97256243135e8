"""Arguments that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

MapFolder = Annotated[Path, typer.Argument(metavar="MAP", help="Folder of a map.")]
Clip = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="CLIP of the semantics of the map, if it was moved."),
]
NumberOfJobs = Annotated[
    int | None,
    typer.Option(
        "--jobs",
        min=1,
        help="Number of processes of this machine; each does one job at a time. "
        "[default: 1; all cores with --scheduler local]",
        show_default=False,
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS|local",
        help="Run the jobs on the workers of a Dask scheduler, such as tcp://10.0.0.1:8786, or on "
        "all cores of this machine.",
    ),
]


def workers_of(jobs: int | None, scheduler: str | None) -> int | str:
    """Return the workers that --jobs and --scheduler ask for; see `gslts.fleet.jobs.Jobs`.

    Args:
        jobs: Number of processes.
        scheduler: Address of a scheduler, or "local".

    Raises:
        ValueError: An address and a number of processes were given.
    """
    if scheduler is None:
        return jobs or 1
    if scheduler == "local":
        return jobs or scheduler
    if jobs is not None:
        raise ValueError("--jobs is for this machine: a scheduler at an address has its workers")
    return scheduler
