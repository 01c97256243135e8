"""Cases of relocalization: a home as it was mapped, the same after changes, and other homes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.io.atomic_files import write_atomic
from gslts.types import Floats
from gslts_bench.cache import cached_folder, code_digest
from gslts_bench.detection.cases import MIN_TASKS, Case, HomeCases, take_frame
from gslts_bench.detection.several import SeveralMaker
from gslts_bench.detection.visits import TRIES, draw_visit
from gslts_bench.homes import BenchHome
from gslts_sim import ROOM_TYPES
from gslts_sim.actions import SceneState
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint, robot_camera
from gslts_sim.task import Task
from gslts_sim.walkable import floor_of

Part = Literal["held-out", "as mapped", "three changes", "another home"]
PARTS: tuple[Part, ...] = ("held-out", "as mapped", "three changes", "another home")
"""Parts of the benchmark, by where frames are taken."""

CHANGES = 3
"""Number of changes that are in view at once."""
VIEWS_PER_SET = 4
"""Number of viewpoints per set of changes, near one that sees all of them."""
MAX_OFFSET_M, MAX_TURN_DEG = 0.3, 20.0
"""Maximum distance of a viewpoint from that one in x and in y, and in yaw."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Frames of one home, localized in its own map or in that of another one.

    Attributes:
        bench: Home where they are taken.
        cases: Visits as it was mapped, but for the light of a lamp, and visits after changes.
        foreign: Whether the map is of another home.
    """

    bench: BenchHome
    cases: HomeCases
    foreign: bool

    def part(self, case: Case) -> Part:
        """Return the part of the benchmark that a case belongs to.

        Args:
            case: One of `cases`.
        """
        if self.foreign:
            return "another home"
        return "as mapped" if case.part == "unchanged" else "three changes"

    def before(self) -> SceneState:
        """Return the default state of its home."""
        return self.bench.default_state(self.cases.initial_actions)

    def take(self, case: Case, before: SceneState) -> tuple[RgbdFrame, Floats]:
        """Take the frame of a case.

        Args:
            case: One of `cases`.
            before: From `before`.

        Returns:
            The frame, and the true world_from_camera [4,4].
        """
        size = (self.bench.setup.width, self.bench.setup.height)
        camera = robot_camera(before.home, case.viewpoint, size)
        return take_frame(case, before, self.bench), camera.world_from_camera


def batches_of(bench: BenchHome, views: int) -> Iterator[Batch]:
    """Yield all cases for the map of a home; make them if they are missing.

    Args:
        bench: The home.
        views: Maximum number of frames per part.

    Raises:
        ValueError: Nothing can be changed in one of the homes.
    """
    yield Batch(bench, _cached_cases(bench, views, views), foreign=False)
    others = other_homes(bench)
    for row, other in enumerate(others):
        count = len(range(row, views, len(others)))
        if count:
            yield Batch(other, _cached_cases(other, count, 0), foreign=True)


def other_homes(bench: BenchHome) -> tuple[BenchHome, BenchHome]:
    """Return a home of another room type, and one of the same type, which is more similar.

    To a foreign home, two of ours. To a flat, whose rooms are the homes of its seed, a room and a
    flat of another seed.

    Args:
        bench: The home.
    """
    types = list(ROOM_TYPES)
    if bench.file is not None:
        first, second = (replace(bench, room_type=name, file=None) for name in types[:2])
        return first, second
    similar = replace(bench, seed=bench.seed ^ 1)  # Seeds go in pairs, which are of one split.
    if bench.room_type not in types:
        return replace(similar, room_type=types[0]), similar
    next_type = types[(types.index(bench.room_type) + 1) % len(types)]
    return replace(bench, room_type=next_type), similar


def make_cases(bench: BenchHome, visits: int, changed: int) -> HomeCases:
    """Draw visits of a home, from where it was not recorded.

    Args:
        bench: The home.
        visits: Number of visits of it as mapped.
        changed: Number of visits after three changes; fewer where it does not give so many.

    Returns:
        The visits.

    Raises:
        ValueError: Nothing can be changed in the home.
    """
    tasks = bench.tasks(MIN_TASKS if changed else 1)
    initial_actions = tasks[0].initial_actions
    before = bench.default_state(initial_actions)
    rng = np.random.default_rng([bench.seed, 2])
    cases = [_visit(number, before.home, rng) for number in range(visits)]
    # Another generator, so that visits do not depend on the number of others.
    rng = np.random.default_rng([bench.seed, 3])
    cases += _make_changed(before, tasks, changed, rng)
    return HomeCases(initial_actions=initial_actions, cases=tuple(cases))


def draw_viewpoint_near(viewpoint: Viewpoint, home: Home, rng: np.random.Generator) -> Viewpoint:
    """Draw a viewpoint near another one.

    Args:
        viewpoint: Viewpoint that sees the changes.
        home: State of the home.
        rng: Source of all randomness.
    """
    floor = floor_of(home)
    for _ in range(TRIES):
        position: Floats = np.round(
            viewpoint.position + rng.uniform(-MAX_OFFSET_M, MAX_OFFSET_M, 2), 3
        )
        if floor.can_stand(position):
            break
    else:
        position = viewpoint.position
    turn_deg = float(rng.uniform(-MAX_TURN_DEG, MAX_TURN_DEG))
    return Viewpoint.at(
        position, round((viewpoint.yaw_deg + turn_deg) % 360, 1), viewpoint.horizon_deg
    )


def _cached_cases(bench: BenchHome, visits: int, changed: int) -> HomeCases:
    def make(folder: Path) -> None:
        folder.mkdir()
        cases = make_cases(bench, visits, changed)
        write_atomic(folder / "cases.json", cases.model_dump_json(indent=1).encode())

    code = code_digest(__name__, without=("gslts.mapping",))
    made_of = {"home": bench.recorded_of, "visits": visits, "changed": changed, "code": code}
    folder = cached_folder(bench.work / "relocalize_frames" / bench.name, made_of, make)
    return HomeCases.model_validate_json((folder / "cases.json").read_bytes())


def _visit(number: int, home: Home, rng: np.random.Generator) -> Case:
    visit = draw_visit(home, rng)
    return Case(
        name=f"visit_{number:02}",
        part="unchanged",
        viewpoint=visit.viewpoint,
        sensor_seed=int(rng.integers(1 << 31)),
        light_shift_m=visit.light_shift_m,
    )


def _make_changed(
    before: SceneState, tasks: list[Task], count: int, rng: np.random.Generator
) -> Iterator[Case]:
    sets = (
        SeveralMaker(before, tasks, rng).make(CHANGES, -(-count // VIEWS_PER_SET)) if count else ()
    )
    for first, several in zip(range(0, count, VIEWS_PER_SET), sets, strict=False):
        after = before
        for action in several.actions:
            after = after.apply(action)
        for number in range(first, min(first + VIEWS_PER_SET, count)):
            exact = number == first
            viewpoint = (
                several.viewpoint
                if exact
                else draw_viewpoint_near(several.viewpoint, after.home, rng)
            )
            yield Case(
                name=f"changed_{number:02}",
                part="triple",
                actions=several.actions,
                viewpoint=viewpoint,
                sensor_seed=int(rng.integers(1 << 31)),
                truths=several.truths,
            )
