"""Which frames are asked about: of a home as it was mapped, of it changed, and of other homes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.io.atomic_files import write_whole
from gslts.types import Floats
from gslts_bench.cache import cached_folder
from gslts_bench.detection.cases import LEAST_TASKS, Case, HomeCases, frame_of
from gslts_bench.detection.several import SeveralMaker
from gslts_bench.detection.visits import draw_visit
from gslts_bench.homes import BenchHome, Tell, default_state
from gslts_sim import ROOM_TYPES
from gslts_sim.actions import SceneState
from gslts_sim.home import Home
from gslts_sim.home_source import HomeSource
from gslts_sim.robot_body import Viewpoint, floor_of, robot_camera
from gslts_sim.task import Task

Part = Literal["kept aside", "as mapped", "three changes", "another home"]
PARTS: tuple[Part, ...] = ("kept aside", "as mapped", "three changes", "another home")

CHANGES = 3
LOOKS = 4
"""At each set of changes, from near a place that sees all of them."""
NEAR_M, NEAR_DEG = 0.3, 20.0
"""How far a look is from that one, at most, in x and in y, and in yaw."""
TRIES = 100
TASKS_S, SET_S = 5.0, 1.5
"""About how long it takes to find the changes of a home, and a look at three, for the progress."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Frames of one home, asked about in the map of the same or of another one.

    Attributes:
        bench: Where they are taken.
        cases: Visits of it as it was mapped, but for the light of a lamp, and with changes.
        strange: Whether the map is of another home.
    """

    bench: BenchHome
    cases: HomeCases
    strange: bool

    def part(self, case: Case) -> Part:
        """What a case of it is asked for."""
        if self.strange:
            return "another home"
        return "as mapped" if case.part == "unchanged" else "three changes"

    def before(self) -> SceneState:
        """The default state of its home."""
        return default_state(self.cases.home, self.cases.initial_actions)

    def look(self, case: Case, before: SceneState) -> tuple[RgbdFrame, Floats]:
        """What the robot sees, and [4,4] where its camera is in truth.

        Args:
            case: Of `cases`.
            before: From `before`.
        """
        size = (self.bench.setup.width, self.bench.setup.height)
        camera = robot_camera(before.home, case.viewpoint, size)
        return frame_of(case, before, self.bench), camera.world_from_camera


def batches_of(
    bench: BenchHome, views: int, code: str, tell: Tell = lambda _: None
) -> Iterator[Batch]:
    """All that is asked about in the map of a home, made unless it is there.

    Args:
        bench: The home.
        views: Frames of each part, at most.
        code: Digest of the code that makes frames.
        tell: Is told of work done, in the seconds that it usually takes.

    Raises:
        ValueError: Nothing can be changed in one of the homes.
    """
    yield Batch(bench, _kept(bench, views, views, code, tell), strange=False)
    others = other_homes(bench)
    for row, other in enumerate(others):
        count = len(range(row, views, len(others)))
        if count:
            yield Batch(other, _kept(other, count, 0, code, tell), strange=True)


def other_homes(bench: BenchHome) -> tuple[BenchHome, BenchHome]:
    """One of another room type, and one of the same, which looks more like it."""
    types = list(ROOM_TYPES)
    next_type = types[(types.index(bench.room_type) + 1) % len(types)]
    # Seeds go in pairs, so that those kept for evaluation stay among themselves.
    return replace(bench, room_type=next_type), replace(bench, seed=bench.seed ^ 1)


def cases_of(bench: BenchHome, visits: int, changed: int, tell: Tell = lambda _: None) -> HomeCases:
    """Visits of a home, from where it was not recorded.

    Args:
        bench: The home.
        visits: Of it as mapped.
        changed: Of it after three changes; fewer where it does not give so many.
        tell: Is told of work done, in the seconds that it usually takes.

    Raises:
        ValueError: Nothing can be changed in it.
    """
    tasks = bench.tasks(LEAST_TASKS if changed else 1)
    tell(TASKS_S)
    source, initial_actions = tasks[0].home, tasks[0].initial_actions
    assert isinstance(source, HomeSource)  # As a bench's home comes from a seed.
    before = default_state(source, initial_actions)
    rng = np.random.default_rng([bench.seed, 2])
    cases = [_visit(number, before.home, rng) for number in range(visits)]
    # Of its own, so that visits do not depend on the number of others.
    rng = np.random.default_rng([bench.seed, 3])
    cases += _changed(before, tasks, changed, rng, tell)
    return HomeCases(home=source, initial_actions=initial_actions, cases=tuple(cases))


def look_near(look: Viewpoint, home: Home, rng: np.random.Generator) -> Viewpoint:
    """Another look from where a robot can stand, at much the same."""
    floor = floor_of(home)
    for _ in range(TRIES):
        place: Floats = np.round(look.position + rng.uniform(-NEAR_M, NEAR_M, 2), 3)
        if floor.can_stand(place):
            break
    else:
        place = look.position
    turn_deg = float(rng.uniform(-NEAR_DEG, NEAR_DEG))
    return Viewpoint.at(place, round((look.yaw_deg + turn_deg) % 360, 1), look.horizon_deg)


def _kept(bench: BenchHome, visits: int, changed: int, code: str, tell: Tell) -> HomeCases:
    def make(folder: Path) -> None:
        folder.mkdir()
        cases = cases_of(bench, visits, changed, tell)
        write_whole(folder / "cases.json", cases.model_dump_json(indent=1).encode())

    home: dict[str, Any] = bench.recorded_of
    made_of = {"home": home, "visits": visits, "changed": changed, "code": code}
    folder = cached_folder(bench.work / "relocalize_frames" / bench.name, made_of, make)
    return HomeCases.model_validate_json((folder / "cases.json").read_bytes())


def _visit(number: int, home: Home, rng: np.random.Generator) -> Case:
    visit = draw_visit(home, rng)
    return Case(
        name=f"visit_{number:02}",
        part="unchanged",
        viewpoint=visit.look,
        sensor_seed=int(rng.integers(1 << 31)),
        light_shift_m=visit.light_shift_m,
    )


def _changed(
    before: SceneState, tasks: list[Task], count: int, rng: np.random.Generator, tell: Tell
) -> Iterator[Case]:
    sets = SeveralMaker(before, tasks, rng).make(CHANGES, -(-count // LOOKS)) if count else ()
    for first, several in zip(range(0, count, LOOKS), sets, strict=False):
        after = before
        for action in several.actions:
            after = after.apply(action)
        for number in range(first, min(first + LOOKS, count)):
            exact = number == first
            look = several.look if exact else look_near(several.look, after.home, rng)
            yield Case(
                name=f"changed_{number:02}",
                part="triple",
                actions=several.actions,
                viewpoint=look,
                sensor_seed=int(rng.integers(1 << 31)),
                truths=several.truths,
            )
        tell(SET_S)
