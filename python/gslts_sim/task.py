"""A scene change task: a small JSON file from which both states of a home can be rebuilt.

Source: GS-LTS, sec. IV-A, Scene Change Adaptation Benchmark.
"""

from __future__ import annotations

from functools import reduce
from pathlib import Path
from typing import Annotated, Literal, Self, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from gslts.io.atomic_files import write_atomic
from gslts_sim.actions import ChangeAction, SceneState
from gslts_sim.changes import ChangeError
from gslts_sim.controller import ActionError, Controller
from gslts_sim.event import Event
from gslts_sim.home import Home
from gslts_sim.home_source import FileSource, HomeSource
from gslts_sim.robot_body import Viewpoint
from gslts_sim.strict_model import StrictModel

VERSION = 1
"""Of the schema."""
MAX_BYTES = 1 << 20
"""Scripts take a few kilobytes; nothing larger is read."""
VIEWPOINTS = 10
"""Near ones, and far ones."""
BOX_TOLERANCE_M = 1e-5

Kind = Literal["addition", "removal", "relocation"]
Script = TypeVar("Script", bound=BaseModel)
Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Box = tuple[Vector, Vector]
"""Lower and upper corner of an axis-aligned box in the world, m."""


class SensorSetup(StrictModel):
    """The camera, and the seeds of its noise before and after the change."""

    noise: str
    width: Annotated[int, Field(ge=16, le=4096)]
    height: Annotated[int, Field(ge=16, le=4096)]
    seed_before: Annotated[int, Field(ge=0)]
    seed_after: Annotated[int, Field(ge=0)]


Viewpoints = Annotated[tuple[Viewpoint, ...], Field(min_length=VIEWPOINTS, max_length=VIEWPOINTS)]


class Change(StrictModel):
    """What a robot should find out."""

    kind: Kind
    object_id: str
    object_type: str
    box_before: Box | None
    box_after: Box | None

    @model_validator(mode="after")
    def _fits(self) -> Self:
        there = (self.box_before is not None, self.box_after is not None)
        expected = {"addition": (False, True), "removal": (True, False), "relocation": (True, True)}
        if there != expected[self.kind]:
            raise ValueError(f"an object of a {self.kind} has other boxes before and after")
        for box in (self.box_before, self.box_after):
            if box is not None and not np.all(np.array(box[0]) <= box[1]):
                raise ValueError("a lower corner of a box is above the upper")
        return self


class TestViewpoints(StrictModel):
    """From where the changed region is seen, nearer and farther than `viewpoints.NEAR_M`."""

    near: Viewpoints
    far: Viewpoints


class Task(StrictModel):
    """One change of one home, and from where to look at it.

    Attributes:
        schema_version: Of this format.
        home: How to rebuild the home.
        sensor: Of the robot.
        viewpoint: From where the robot sees the change first.
        initial_actions: From the home as it is made to its default state, which the map shows.
        change_actions: From the default to the changed state.
        change: What differs.
        test_viewpoints: Where the updated map is judged.
    """

    schema_version: Literal[1] = 1
    home: HomeSource | FileSource
    sensor: SensorSetup
    viewpoint: Viewpoint
    initial_actions: tuple[ChangeAction, ...]
    change_actions: Annotated[tuple[ChangeAction, ...], Field(min_length=1)]
    change: Change
    test_viewpoints: TestViewpoints

    def states(self, home: Home) -> tuple[SceneState, SceneState]:
        """The default and the changed state, both as `change` says.

        Args:
            home: What `self.home.load` gave.

        Raises:
            ValueError: An action fails, or leads to something else.
        """
        before = _after(SceneState(home), "initial_actions", self.initial_actions)
        return before, self.apply_change(before)

    def apply_change(self, before: SceneState) -> SceneState:
        """The changed state, when the default one is known.

        Raises:
            ValueError: An action fails, or one of the two is not as `change` says.
        """
        after = _after(before, "change_actions", self.change_actions)
        for name, state, box in (
            ("box_before", before, self.change.box_before),
            ("box_after", after, self.change.box_after),
        ):
            if not _agrees(state.home, self.change, box):
                raise ValueError(f"change: {self.change.object_id} is not as {name} says")
        return after

    def start(self, home: Home, *, changed: bool) -> Controller:
        """A robot at the initial viewpoint, before or after the change.

        Args:
            home: What `self.home.load` gave.
            changed: Whether the change has happened.

        Raises:
            ValueError: There is no such noise, an action fails or leads to something else than
                `change` says, or the robot cannot stand there.
        """
        robot = Controller(
            self.states(home)[int(changed)],
            width=self.sensor.width,
            height=self.sensor.height,
            noise=self.sensor.noise,
            seed=self.sensor.seed_after if changed else self.sensor.seed_before,
        )
        self._go(robot, self.viewpoint)
        return robot

    def observe(self, robot: Controller, number: int) -> Event:
        """What a robot of `start` sees, the same in whatever order the looks are taken.

        Args:
            robot: Is taken to the viewpoint.
            number: 0 for the initial viewpoint, from 1 on the near ones, then the far ones.

        Raises:
            ValueError: The robot cannot stand there.
        """
        sets = self.test_viewpoints
        self._go(robot, (self.viewpoint, *sets.near, *sets.far)[number])
        return robot.snapshot(number)

    def _go(self, robot: Controller, viewpoint: Viewpoint) -> None:
        try:
            robot.go(viewpoint)
        except (ActionError, ValueError) as error:
            raise ValueError(f"viewpoint: {error}") from None


def _after(state: SceneState, name: str, actions: tuple[ChangeAction, ...]) -> SceneState:
    def done(state: SceneState, numbered: tuple[int, ChangeAction]) -> SceneState:
        number, action = numbered
        try:
            return state.apply(action)
        except ChangeError as error:
            raise ValueError(f"{name}[{number}]: {action.action}: {error}") from None

    return reduce(done, enumerate(actions), state)


def _agrees(home: Home, change: Change, box: Box | None) -> bool:
    """Whether an object is of the type and in the box that a change tells, or gone."""
    if box is None or change.object_id not in home:
        return box is None and change.object_id not in home
    thing = home[change.object_id]
    same = np.allclose(thing.box_in_world, box, rtol=0, atol=BOX_TOLERANCE_M)
    return thing.type == change.object_type and same


class _Versioned(BaseModel):
    model_config = ConfigDict(strict=True)

    schema_version: int


def read_task(path: Path) -> Task:
    """Reads a task.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is no task, or of another schema version.
    """
    return read_script(path, Task)


def read_script(path: Path, model: type[Script]) -> Script:
    """Reads a script of a home.

    Args:
        path: Of the JSON file.
        model: What it should be.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is something else, or of another schema version.
    """
    with path.open("rb") as file:
        text = file.read(MAX_BYTES + 1)
    if len(text) > MAX_BYTES:
        raise ValueError(f"{path}: larger than {MAX_BYTES >> 20} MiB, so it is no script of a home")
    try:
        version = _Versioned.model_validate_json(text).schema_version
        if version != VERSION:
            raise ValueError(f"{path}: schema_version is {version}, this gslts reads {VERSION}")
        return model.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "file"
        raise ValueError(f"{path}: {where}: {first['msg']}") from None


def write_task(task: Task, path: Path) -> None:
    """Writes a task, all of it or nothing.

    Raises:
        OSError: The file cannot be written.
    """
    write_atomic(path, (task.model_dump_json(indent=1) + "\n").encode())
