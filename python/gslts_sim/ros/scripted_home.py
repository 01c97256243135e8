"""A home whose changes happen one after the other, on request."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.types import Floats
from gslts_sim.actions import SceneState
from gslts_sim.changes import ChangeError
from gslts_sim.day import ChangeEvent
from gslts_sim.raycast import RayCaster
from gslts_sim.robot_body import body_boxes
from gslts_sim.sensor import Sensor
from gslts_sim.walkable import WalkableFloor, floor_of


@dataclass(frozen=True, eq=False)
class Scene:
    """A state of a home, as the robot meets it.

    Args:
        state: The home, and what was removed from it.
        floor: On which the robot drives.
        caster: Renders what its camera sees.
        label_rows: [O] int32, row of each object of the home in `ScriptedHome.label_names`.
    """

    state: SceneState
    floor: WalkableFloor
    caster: RayCaster
    label_rows: NDArray[np.int32]


class ScriptedHome:
    """A home and its changes to come.

    Args:
        state: The home before the changes.
        events: Changes, in this order.
        sensor: Camera of the robot; decides which lights are on.

    Attributes:
        scene: Present state. It is replaced as a whole: who reads it in another thread sees the
            state before or after a change.
        label_names: Types of all objects, of removed ones as well.
    """

    def __init__(self, state: SceneState, events: Iterable[ChangeEvent], sensor: Sensor) -> None:
        self._events, self._sensor = list(events), sensor
        objects = [*state.home.objects, *state.removed.values()]
        self.label_names = tuple(obj.type for obj in objects)
        self._rows = {obj.id: row for row, obj in enumerate(objects)}
        self.scene = self._scene_of(state)

    @property
    def changes_left(self) -> int:
        """Number of changes to come."""
        return len(self._events)

    def change(self, position: Callable[[], Floats]) -> str:
        """Let the next change happen.

        Args:
            position: Returns the present position (2,) of the robot, m.

        Returns:
            Description of the change.

        Raises:
            ChangeError: There is none left, or the robot is in the way; then the change remains the
                next one.
        """
        if not self._events:
            raise ChangeError("no change is left")
        event, before = self._events[0], self.scene
        state = before.state
        for action in event.actions:
            state = state.apply(action, body_boxes(state.home, position()))
        scene = self._scene_of(state)
        robot = position()  # It may have moved in the meantime.
        if before.floor.is_free(robot) and not scene.floor.is_free(robot):
            raise ChangeError(f"the robot is in the way of {event.change.object_id}")
        self.scene = scene
        self._events.pop(0)
        return f"{event.change.kind} of {event.change.object_id}"

    def _scene_of(self, state: SceneState) -> Scene:
        caster = RayCaster(state.home, self._sensor.lights(state.home))
        rows = np.array([self._rows[obj.id] for obj in state.home.objects], np.int32)
        return Scene(state, floor_of(state.home), caster, rows)
