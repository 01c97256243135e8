"""A day of a home: what changes in it between the rounds of a robot, as a small JSON file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from gslts_sim.actions import ChangeAction, SceneState
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.changes import ChangeError
from gslts_sim.controller import Controller
from gslts_sim.home import Home
from gslts_sim.home_source import FileSource, HomeSource
from gslts_sim.strict_model import StrictModel
from gslts_sim.task import Change, SensorSetup, Task, read_script
from gslts_sim.tasks import TaskMaker

PAIR_EVERY = 3
"""Of so many rounds, one meets two changes at once."""


class ChangeEvent(StrictModel):
    """One change.

    Attributes:
        actions: What is done.
        change: What a robot should find out.
    """

    actions: Annotated[tuple[ChangeAction, ...], Field(min_length=1)]
    change: Change


class Day(StrictModel):
    """A home and what happens in it.

    Attributes:
        schema_version: Of this format.
        home: How to rebuild the home.
        sensor: Of the robot.
        initial_actions: From the home as it is made to how it is before the day.
        rounds: What happens before each round of the robot.
    """

    schema_version: Literal[1] = 1
    home: HomeSource | FileSource
    sensor: SensorSetup
    initial_actions: tuple[ChangeAction, ...]
    rounds: tuple[tuple[ChangeEvent, ...], ...]

    def state(self, home: Home, gone: int) -> SceneState:
        """The home after what happened before the first rounds.

        Args:
            home: What `self.home.load` gave.
            gone: How many rounds; more than there are change nothing more.

        Raises:
            ValueError: An action fails.
        """
        happened = [one for of_round in self.rounds[:gone] for one in of_round]
        actions = [action for one in happened for action in one.actions]
        try:
            return SceneState(home).apply_all([*self.initial_actions, *actions])
        except ChangeError as error:
            raise ValueError(f"day: {error}") from None

    def robot(self, home: Home, gone: int) -> Controller:
        """A robot in that home.

        Args:
            home: What `self.home.load` gave.
            gone: See `state`; the noise of the camera depends on it, too.

        Raises:
            ValueError: An action fails, or there is no such noise.
        """
        sensor = self.sensor
        return Controller(
            self.state(home, gone),
            width=sensor.width,
            height=sensor.height,
            noise=sensor.noise,
            seed=sensor.seed_before if gone == 0 else sensor.seed_after + gone,
        )


def make_day(
    source: HomeSource | FileSource, home: Home, setting: TaskSettings, seed: int, changes: int
) -> Day:
    """A day with some additions, removals and relocations.

    Args:
        source: Of the home.
        home: It.
        setting: Of the robot's camera.
        seed: Same seed, same day.
        changes: How many.

    Raises:
        ValueError: Fewer changes can be done.
    """
    tasks = list(TaskMaker(setting, seed).make_sequence(source, home, changes))
    if len(tasks) < changes:
        raise ValueError(f"{home.name}: {len(tasks)} of {changes} changes are possible")
    rounds: list[list[Task]] = []
    for task in tasks:
        if rounds and len(rounds) % PAIR_EVERY == 0 and _goes_with(rounds[-1], task):
            rounds[-1].append(task)
        else:
            rounds.append([task])
    return Day(
        home=source,
        sensor=tasks[0].sensor,
        initial_actions=tasks[0].initial_actions,
        rounds=tuple(
            tuple(ChangeEvent(actions=one.change_actions, change=one.change) for one in of_round)
            for of_round in rounds
        ),
    )


def read_day(path: Path) -> Day:
    """Reads a day.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is no day, or of another schema version.
    """
    return read_script(path, Day)


def _goes_with(tasks: Sequence[Task], task: Task) -> bool:
    """Whether a change can be a second one of a round: of another object."""
    return len(tasks) == 1 and tasks[0].change.object_id != task.change.object_id
