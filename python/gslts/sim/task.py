"""A scene change task: a small JSON file from which both states of a home can be rebuilt.

Source: GS-LTS, sec. IV-A, Scene Change Adaptation Benchmark.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, FiniteFloat, ValidationError

from gslts.files import write_whole
from gslts.sim.controller import ActionError, Controller
from gslts.sim.home import Home
from gslts.sim.home_source import STRICT, FileSource, HomeSource

VERSION = 1
"""Of the schema."""
MAX_BYTES = 1 << 20
"""Scripts take a few kilobytes; nothing larger is read."""

Point = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Box = tuple[Point, Point]
"""Lower and upper corner of an axis-aligned box in the world, m."""


class _Model(BaseModel):
    model_config = STRICT


class SensorSetup(_Model):
    """The camera, and the seeds of its noise before and after the change."""

    noise: str
    width: Annotated[int, Field(ge=16, le=4096)]
    height: Annotated[int, Field(ge=16, le=4096)]
    seed_before: Annotated[int, Field(ge=0)]
    seed_after: Annotated[int, Field(ge=0)]


class Place2d(_Model):
    """x and y on the floor, m."""

    x: FiniteFloat
    y: FiniteFloat


class Viewpoint(_Model):
    """Arguments of Teleport: where the robot stands and looks, degrees."""

    position: Place2d
    rotation: FiniteFloat
    horizon: FiniteFloat


class Action(_Model):
    """An action that changes the home, with its arguments in AI2-THOR's words."""

    action: Literal["InitialRandomSpawn", "DisableObject", "EnableObject", "PlaceObjectAtPoint"]
    arguments: dict[str, Any]


class Change(_Model):
    """What a robot should find out."""

    kind: Literal["addition", "removal", "relocation"]
    object_id: str
    object_type: str
    box_before: Box | None
    box_after: Box | None


class ViewpointSets(_Model):
    """From where the changed region is seen, nearer and farther than `tasks.NEAR_M`."""

    near: tuple[Viewpoint, ...]
    far: tuple[Viewpoint, ...]


class Task(_Model):
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
    initial_actions: tuple[Action, ...]
    change_actions: tuple[Action, ...]
    change: Change
    test_viewpoints: ViewpointSets

    def start(self, home: Home, *, changed: bool) -> Controller:
        """A robot at the initial viewpoint, before or after the change.

        Args:
            home: What `self.home.load` gave.
            changed: Whether the change has happened.

        Raises:
            ValueError: There is no such noise, an action fails, or the robot cannot stand there.
        """
        sensor = self.sensor
        robot = Controller(
            home,
            width=sensor.width,
            height=sensor.height,
            noise=sensor.noise,
            seed=sensor.seed_after if changed else sensor.seed_before,
        )
        actions = [("initial_actions", self.initial_actions)]
        if changed:
            actions.append(("change_actions", self.change_actions))
        for name, several in actions:
            for number, one in enumerate(several):
                try:
                    robot.act(one.action, **one.arguments)
                except (ActionError, ValueError) as error:
                    raise ValueError(f"{name}[{number}]: {error}") from None
        self.go(robot, self.viewpoint)
        return robot

    @staticmethod
    def go(robot: Controller, viewpoint: Viewpoint) -> None:
        """Takes the robot to a viewpoint.

        Raises:
            ValueError: It cannot stand there.
        """
        try:
            robot.act("Teleport", **viewpoint.model_dump())
        except ActionError as error:
            raise ValueError(f"viewpoint: {error}") from None


class _Versioned(BaseModel):
    schema_version: int


def read_task(path: Path) -> Task:
    """Reads a task.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is no task, or of another schema version.
    """
    with path.open("rb") as file:
        text = file.read(MAX_BYTES + 1)
    if len(text) > MAX_BYTES:
        raise ValueError(f"{path}: larger than {MAX_BYTES >> 20} MiB, so it is no task")
    try:
        version = _Versioned.model_validate_json(text).schema_version
        if version != VERSION:
            raise ValueError(f"{path}: schema_version is {version}, this gslts reads {VERSION}")
        return Task.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "file"
        raise ValueError(f"{path}: {where}: {first['msg']}") from None


def write_task(task: Task, path: Path) -> None:
    """Writes a task, all of it or nothing.

    Raises:
        OSError: The file cannot be written.
    """
    write_whole(path, (task.model_dump_json(indent=1) + "\n").encode())
