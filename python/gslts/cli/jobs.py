"""Options and progress of commands whose jobs run on many workers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from tqdm import tqdm

BAR = "{desc}: {n:.0f} of {total:.0f} |{bar}| {elapsed}<{remaining}{postfix}"
"""Format of the progress bar, in results."""
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


def fail(errors: dict[str, str]) -> None:
    """Print the errors of jobs.

    Args:
        errors: Reason by id of the result or name of the unit that failed.

    Raises:
        RuntimeError: There is an error.
    """
    for name, error in errors.items():
        typer.echo(f"{name}: {error}", err=True)
    if errors:
        raise RuntimeError(f"{len(errors)} results failed, named above")


@contextmanager
def progress_bar(doing: str) -> Iterator[tqdm[Any]]:
    """Show a bar of results, whose total comes later; say after Ctrl-C that a run can go on.

    Args:
        doing: Description of the bar.
    """
    from tqdm import tqdm

    try:
        with tqdm(total=1, desc=doing, bar_format=BAR, smoothing=0.05, disable=None) as bar:
            yield bar
    except KeyboardInterrupt:
        typer.echo("gslts: stopped; the same command continues where it stopped", err=True)
        raise
