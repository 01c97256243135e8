"""Scene change tasks: small JSON files from which both states of a home can be rebuilt.

Source: GS-LTS, sec. IV-A, Scene Change Adaptation Benchmark.
"""

from __future__ import annotations

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
"""Version of the JSON schema."""
MAX_BYTES = 1 << 20
"""Maximum size of a script, bytes; they take a few kilobytes."""
VIEWPOINTS = 10
"""Number of near test viewpoints, and of far ones."""
BOX_TOLERANCE_M = 1e-5
"""Maximum difference between a box in a script, which is rounded to 1e-6 m, and its replay."""

Kind = Literal["addition", "removal", "relocation", "shift"]
Script = TypeVar("Script", bound=BaseModel)
Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Box = tuple[Vector, Vector]
"""Lower and upper corner of an axis-aligned box in the world, m."""


class SensorSetup(StrictModel):
    """The camera of the robot, and the seeds of its noise before and after the change."""

    noise: str
    width: Annotated[int, Field(ge=16, le=4096)]
    height: Annotated[int, Field(ge=16, le=4096)]
    seed_before: Annotated[int, Field(ge=0)]
    seed_after: Annotated[int, Field(ge=0)]


Viewpoints = Annotated[tuple[Viewpoint, ...], Field(min_length=VIEWPOINTS, max_length=VIEWPOINTS)]


class Change(StrictModel):
    """Ground truth of a change: the object and its boxes before and after."""

    kind: Kind
    object_id: str
    object_type: str
    box_before: Box | None
    box_after: Box | None

    @model_validator(mode="after")
    def _fits(self) -> Self:
        present = (self.box_before is not None, self.box_after is not None)
        if present != (self.kind != "addition", self.kind != "removal"):
            raise ValueError(f"box_before or box_after does not fit the kind {self.kind}")
        for box in (self.box_before, self.box_after):
            if box is not None and not np.all(np.array(box[0]) <= box[1]):
                raise ValueError("a lower corner of a box is above the upper")
        return self


class ViewpointSets(StrictModel):
    """Test viewpoints, nearer and farther than `task_viewpoints.MAX_NEAR_VIEW_M`."""

    near: Viewpoints
    far: Viewpoints


class Task(StrictModel):
    """Change of a home, and the viewpoints that see it.

    Args:
        schema_version: Version of the JSON schema.
        home: Reference to the home.
        sensor: Camera of the robot.
        viewpoint: From which the robot first sees the change.
        initial_actions: Lead from the generated home to its default state, which is mapped.
        change_actions: Lead from the default to the changed state.
        change: Difference between the two states.
        test_viewpoints: At which the updated map is evaluated.
    """

    schema_version: Literal[1] = 1
    home: HomeSource | FileSource
    sensor: SensorSetup
    viewpoint: Viewpoint
    initial_actions: tuple[ChangeAction, ...]
    change_actions: Annotated[tuple[ChangeAction, ...], Field(min_length=1)]
    change: Change
    test_viewpoints: ViewpointSets

    def states(self, home: Home) -> tuple[SceneState, SceneState]:
        """Return the default and the changed state.

        Args:
            home: Result of `self.home.load`.

        Raises:
            ValueError: An action fails, or a state differs from `change`.
        """
        before = _apply_all(SceneState(home), "initial_actions", self.initial_actions)
        return before, self.apply_change(before)

    def apply_change(self, before: SceneState) -> SceneState:
        """Return the changed state.

        Args:
            before: The default state.

        Raises:
            ValueError: An action fails, or one of the two states differs from `change`.
        """
        after = _apply_all(before, "change_actions", self.change_actions)
        for name, state, box in (
            ("box_before", before, self.change.box_before),
            ("box_after", after, self.change.box_after),
        ):
            if not _agrees(state.home, self.change, box):
                raise ValueError(f"change: {self.change.object_id} is not as {name} says")
        return after

    def start(self, home: Home, *, changed: bool) -> Controller:
        """Return a robot at the initial viewpoint.

        Args:
            home: Result of `self.home.load`.
            changed: Start after the change instead of before.

        Raises:
            ValueError: There is no such noise preset, an action fails, a state differs from
                `change`, or the robot cannot stand there.
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
        """Return what a robot sees at a viewpoint; it does not depend on earlier observations.

        Args:
            robot: Result of `start`; it is moved to the viewpoint.
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


def _apply_all(state: SceneState, name: str, actions: tuple[ChangeAction, ...]) -> SceneState:
    """Return the state after actions, or raise a ValueError that names the failing one."""
    for number, action in enumerate(actions):
        try:
            state = state.apply(action)
        except ChangeError as error:
            raise ValueError(f"{name}[{number}]: {action.action}: {error}") from None
    return state


def _agrees(home: Home, change: Change, box: Box | None) -> bool:
    """Return whether the changed object has a type and a box, or is absent if the box is None."""
    if box is None or change.object_id not in home:
        return box is None and change.object_id not in home
    obj = home[change.object_id]
    same = np.allclose(obj.box_in_world, box, rtol=0, atol=BOX_TOLERANCE_M)
    return obj.type == change.object_type and same


class _Versioned(BaseModel):
    model_config = ConfigDict(strict=True)

    schema_version: int


def read_task(path: Path) -> Task:
    """Read a task.

    Args:
        path: A JSON file.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is not a task, or of another schema version.
    """
    return read_script(path, Task)


def read_script(path: Path, model: type[Script]) -> Script:
    """Read a script of a home.

    Args:
        path: A JSON file.
        model: Expected model, such as `Task`.

    Raises:
        OSError: The file cannot be read.
        ValueError: It does not fit the model, or is of another schema version.
    """
    with path.open("rb") as file:
        text = file.read(MAX_BYTES + 1)
    if len(text) > MAX_BYTES:
        raise ValueError(f"{path}: larger than {MAX_BYTES >> 20} MiB; expected a task or a day")
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
    """Write a task atomically.

    Args:
        task: The task.
        path: Of the JSON file.

    Raises:
        OSError: The file cannot be written.
    """
    write_atomic(path, (task.model_dump_json(indent=1) + "\n").encode())
