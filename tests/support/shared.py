"""Costly things that many tests share: made once a run, by the process that needs them first."""

import atexit
import json
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from gslts_bench.cache import cached_folder
from gslts_sim.explore import explore
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint

VARIABLE = "GSLTS_TEST_SHARED"
"""Names the folder of a run: all processes of it, and pytest runs one after the other, use one."""


def share_folder() -> None:
    """Make the folder of this run unless there is one; it is removed when its process exits."""
    if VARIABLE not in os.environ:
        os.environ[VARIABLE] = tempfile.mkdtemp(prefix="gslts-tests-")
        atexit.register(shutil.rmtree, os.environ[VARIABLE], ignore_errors=True)


def made_once(name: str, make: Callable[[Path], None]) -> Path:
    """Return the folder of a name, made once a run.

    Args:
        name: Unlike that of anything else.
        make: Is given the path of a folder that it makes; others wait until it has returned.
    """
    return cached_folder(Path(os.environ[VARIABLE]) / name, {}, make)


def viewpoints_all_around(name: str, home: Home, most: int) -> list[Viewpoint]:
    """Return `explore(home, most)[0]`, made once a run.

    Args:
        name: Of the home, unlike that of any other.
        home: To look at.
        most: Number of views at most.
    """

    def make(folder: Path) -> None:
        folder.mkdir()
        viewpoints, _ = explore(home, most)
        numbers = [
            [viewpoint.x, viewpoint.y, viewpoint.yaw_deg, viewpoint.horizon_deg]
            for viewpoint in viewpoints
        ]
        (folder / "viewpoints.json").write_text(json.dumps(numbers))

    numbers = json.loads(
        (made_once(f"{name}_{most}_viewpoints", make) / "viewpoints.json").read_text()
    )
    return [Viewpoint(x, y, yaw, horizon) for x, y, yaw, horizon in numbers]
