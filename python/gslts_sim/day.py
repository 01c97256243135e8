"""A day of a home: its changes between the rounds of a robot, as a small JSON file."""

from __future__ import annotations

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

PAIR_INTERVAL = 3
"""One round in this many meets two changes at once."""


class ChangeEvent(StrictModel):
    """Change of a home in a day.

    Args:
        actions: That make the change.
        change: Ground truth of the change.
    """

    actions: Annotated[tuple[ChangeAction, ...], Field(min_length=1)]
    change: Change


class Day(StrictModel):
    """A home and its changes in a day.

    Args:
        schema_version: Version of the JSON schema.
        home: Reference to the home.
        sensor: Camera of the robot.
        initial_actions: Lead from the generated home to its state before the day.
        rounds: Changes before each round of the robot.
    """

    schema_version: Literal[1] = 1
    home: HomeSource | FileSource
    sensor: SensorSetup
    initial_actions: tuple[ChangeAction, ...]
    rounds: tuple[tuple[ChangeEvent, ...], ...]

    def state(self, home: Home, rounds_over: int) -> SceneState:
        """Return the state of the home after the changes of the first rounds.

        Args:
            home: Result of `self.home.load`.
            rounds_over: Number of rounds; more than there are change nothing more.

        Raises:
            ValueError: An action fails.
        """
        events = [event for events in self.rounds[:rounds_over] for event in events]
        actions = [action for event in events for action in event.actions]
        try:
            return SceneState(home).apply_all([*self.initial_actions, *actions])
        except ChangeError as error:
            raise ValueError(f"day: {error}") from None

    def robot(self, home: Home, rounds_over: int) -> Controller:
        """Return a robot in the home after the changes of the first rounds.

        Args:
            home: Result of `self.home.load`.
            rounds_over: Number of rounds; the noise of the camera depends on it, too.

        Raises:
            ValueError: An action fails, or there is no such noise preset.
        """
        sensor = self.sensor
        return Controller(
            self.state(home, rounds_over),
            width=sensor.width,
            height=sensor.height,
            noise=sensor.noise,
            seed=sensor.seed_before if rounds_over == 0 else sensor.seed_after + rounds_over,
        )


def make_day(
    source: HomeSource | FileSource, home: Home, settings: TaskSettings, seed: int, changes: int
) -> Day:
    """Sample a day with additions, removals and relocations.

    Args:
        source: Reference to the home.
        home: The home.
        settings: Settings of the robot's camera.
        seed: Same seed, same day.
        changes: Number of changes.

    Raises:
        ValueError: Fewer changes are possible.
    """
    tasks = list(TaskMaker(settings, seed).make_sequence(source, home, changes))
    if len(tasks) < changes:
        raise ValueError(f"{home.name}: {len(tasks)} of {changes} changes are possible")
    rounds: list[list[Task]] = []
    for task in tasks:
        if rounds and len(rounds) % PAIR_INTERVAL == 0 and _can_join(rounds[-1], task):
            rounds[-1].append(task)
        else:
            rounds.append([task])
    return Day(
        home=source,
        sensor=tasks[0].sensor,
        initial_actions=tasks[0].initial_actions,
        rounds=tuple(
            tuple(ChangeEvent(actions=task.change_actions, change=task.change) for task in of_round)
            for of_round in rounds
        ),
    )


def read_day(path: Path) -> Day:
    """Read a day.

    Args:
        path: A JSON file.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is not a day, or of another schema version.
    """
    return read_script(path, Day)


def _can_join(tasks: list[Task], task: Task) -> bool:
    """Return whether a change can be the second one of a round: it concerns another object."""
    return len(tasks) == 1 and tasks[0].change.object_id != task.change.object_id
