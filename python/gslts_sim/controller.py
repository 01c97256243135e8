"""A robot in a simulated home, driven by the actions of AI2-THOR (Kolve et al. 2017).

Actions, their arguments and the metadata have AI2-THOR's names, but all coordinates are those of
the project: world with z up, right-handed, metres. The agent's rotation is its yaw about z in
degrees, from x to y; RotateRight makes it smaller.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.types import Floats
from gslts_sim.actions import (
    GRID_M,
    AnyAction,
    Move,
    Pass,
    Rotate,
    SceneState,
    Teleport,
    Tilt,
    parse_action,
)
from gslts_sim.changes import ChangeError
from gslts_sim.event import Event, Palette, make_event, xyz
from gslts_sim.home import Home
from gslts_sim.raycast import RayCaster
from gslts_sim.robot_body import FOV_RAD, HORIZON_DEG, Viewpoint, body_boxes, robot_camera
from gslts_sim.sensor import Sensor, SensorNoise
from gslts_sim.walkable import floor_of, start_position

_MOVES_DEG = {"MoveAhead": 0.0, "MoveLeft": 90.0, "MoveBack": 180.0, "MoveRight": -90.0}
"""Direction of each step relative to the robot's yaw, degrees."""


class ActionError(Exception):
    """An impossible action; the message says why."""


class Controller:
    """A robot in a home, as a `gslts.core.robot.Robot`; actions change the robot and the home.

    Args:
        home: The home, or its state with the removed objects that may return; the robot starts at
            the grid position nearest to the middle of the home.
        width: Of the images, px.
        height: Of the images, px.
        fov_rad: Horizontal field of view of the camera, rad.
        noise: Noise model of the camera, or the name of a preset.
        seed: Seed of the noise of this visit.

    Raises:
        ValueError: The robot can stand nowhere, or there is no such preset.
    """

    def __init__(
        self,
        home: Home | SceneState,
        *,
        width: int = 640,
        height: int = 480,
        fov_rad: float = FOV_RAD,
        noise: SensorNoise | str = "none",
        seed: int = 0,
    ) -> None:
        self._size, self._fov_rad = (width, height), fov_rad
        self._sensor = Sensor(noise, seed)
        self._frames = 0
        state = SceneState(home) if isinstance(home, Home) else home
        self._palette = Palette([*state.home.objects, *state.removed.values()])
        self._set_state(state)
        self._position = start_position(state.home, self._floor)
        self._yaw_deg, self._horizon_deg = 0.0, 0.0
        self._last_pose: Floats | None = None
        self._last_event: Event | None = None

    @property
    def home(self) -> Home:
        """The home in its current state."""
        return self._state.home

    @property
    def last_event(self) -> Event:
        """Event of the last step; before the first step, one of the start."""
        if self._last_event is None:
            self._last_event = self._observe("Pass", "", None, 0)
        return self._last_event

    def step(self, action: str, **arguments: Any) -> Event:
        """Execute an action and observe; a failure is reported in the metadata.

        Args:
            action: One of MoveAhead, MoveBack, MoveLeft, MoveRight (`moveMagnitude`, m),
                RotateLeft, RotateRight, LookUp, LookDown (`degrees`), Teleport (`position` with x
                and y, `rotation` in degrees, `horizon`), GetReachablePositions, Pass,
                InitialRandomSpawn (`randomSeed`, `numPlacementAttempts`), DisableObject and
                EnableObject (`objectId`), PlaceObjectAtPoint (`objectId`, `position` with x, y and
                z of the middle of its underside, m, `rotation` in degrees), ShiftObject
                (`objectId`, `dx` and `dy`, m, `degrees`).
            arguments: Of the action.

        Returns:
            The event after the action.

        Raises:
            ValueError: The action or an argument is unknown or invalid.
        """
        error, result = "", None
        try:
            result = self.act(action, **arguments)
        except ActionError as reason:
            error = str(reason)
        self._last_event = self._observe(action, error, result, self._frames)
        self._frames += 1
        return self._last_event

    def act(self, name: str, /, **arguments: Any) -> Any:
        """Execute an action without an observation.

        Args:
            name: Of the action, as in `step`.
            arguments: Of the action.

        Returns:
            AI2-THOR's `actionReturn`, such as reachable positions.

        Raises:
            ActionError: The action is impossible.
            ValueError: The action or an argument is unknown or invalid.
        """
        try:
            action = parse_action(name, arguments)
        except ValueError as reason:
            raise ValueError(f"Controller: {reason}") from None
        try:
            return self._do(action)
        except (ActionError, ChangeError) as reason:
            raise ActionError(f"{name}: {reason}") from None

    def go(self, viewpoint: Viewpoint) -> None:
        """Teleport to a viewpoint.

        Args:
            viewpoint: The destination.

        Raises:
            ActionError: The robot cannot stand there, or the horizon is out of range.
        """
        x, y = viewpoint.x, viewpoint.y
        self.act(
            "Teleport",
            position={"x": x, "y": y},
            rotation=viewpoint.yaw_deg,
            horizon=viewpoint.horizon_deg,
        )

    def snapshot(self, number: int) -> Event:
        """Observe with the noise of a given frame; the frame counter does not change.

        Args:
            number: Of the frame in the visit, from 0.
        """
        return self._observe("Pass", "", None, number)

    def observe(self) -> RgbdFrame:
        """Take a frame at the current pose."""
        return self.step("Pass").observation

    def pose(self) -> Floats:
        """Return [4,4] world_from_camera that the robot believes, m.

        Its error is drawn from the noise model of the frames, once between two frames.
        """
        return self._sensor.believed_pose(self._camera(), self._frames)

    def reachable_positions(self) -> Floats:
        """Return the grid positions [P,2] that the robot can reach from here, x and y, m."""
        return self._floor.grid_positions(GRID_M, self._position)

    def move_towards(
        self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """Move to the reachable grid position nearest to a position.

        Args:
            position: (2,) x and y, m.
            yaw_rad: Yaw after the move, rad.
            pitch_rad: Angle of the camera below the horizon, rad, clipped to its range; None keeps
                it.

        Returns:
            Whether the robot moved.
        """
        positions = self.reachable_positions()
        position = positions[np.argmin(np.linalg.norm(positions - position, axis=1))]
        down_deg = self._horizon_deg if pitch_rad is None else float(np.rad2deg(pitch_rad))
        down_deg = float(np.clip(down_deg, *HORIZON_DEG))
        try:
            self.go(Viewpoint.at(position, float(np.rad2deg(yaw_rad)) % 360, down_deg))
        except ActionError:
            return False
        return True

    def _set_state(self, state: SceneState) -> None:
        self._state, self._floor = state, floor_of(state.home)
        self._caster: RayCaster | None = None  # Made when needed: more changes may follow.

    def _do(self, action: AnyAction) -> Any:
        match action:
            case Move():
                self._move(_MOVES_DEG[action.action], action.moveMagnitude)
            case Rotate():
                turn = action.degrees if action.action == "RotateLeft" else -action.degrees
                self._yaw_deg = (self._yaw_deg + turn) % 360
            case Tilt():
                turn = action.degrees if action.action == "LookDown" else -action.degrees
                self._horizon_deg = _within_horizon(self._horizon_deg + turn)
            case Teleport():
                self._teleport(action)
            case Pass():
                if action.action == "GetReachablePositions":
                    height = float(self.home.space.box[0, 2])
                    return [xyz((x, y, height)) for x, y in self.reachable_positions()]
            case _:
                self._set_state(self._state.apply(action, body_boxes(self.home, self._position)))
        return None

    def _move(self, towards_deg: float, metres: float) -> None:
        angle = np.deg2rad(self._yaw_deg + towards_deg)
        step = metres * np.array([np.cos(angle), np.sin(angle)])
        pieces = max(2, int(np.ceil(metres / self._floor.cell_m)) + 1)
        for share in np.linspace(0, 1, pieces)[1:]:
            if not self._floor.is_free(self._position + share * step):
                raise ActionError(f"the path of {metres:g} m is blocked")
        self._position = self._position + step

    def _teleport(self, action: Teleport) -> None:
        position = self._position
        if action.position is not None:
            position = np.array([action.position.x, action.position.y])
            if not self._floor.is_free(position):
                raise ActionError(f"the robot cannot stand at ({position[0]:g}, {position[1]:g})")
        if action.horizon is not None:
            self._horizon_deg = _within_horizon(action.horizon)
        if action.rotation is not None:
            self._yaw_deg = action.rotation % 360
        self._position, self._last_pose = position, None  # No motion blur after a teleport.

    def _camera(self) -> Camera:
        """Return the camera at its true pose."""
        viewpoint = Viewpoint.at(self._position, self._yaw_deg, self._horizon_deg)
        return robot_camera(self.home, viewpoint, self._size, self._fov_rad)

    def _observe(self, action: str, error: str, result: Any, number: int) -> Event:
        camera = self._camera()
        if self._caster is None:
            self._caster = RayCaster(self.home, self._sensor.lights(self.home))
        frame, truth = self._sensor.take(self._caster, camera, number, self._last_pose)
        self._last_pose = camera.world_from_camera
        metadata = {
            "agent": {
                "position": xyz((*self._position, self.home.space.box[0, 2])),
                "rotation": xyz((0, 0, self._yaw_deg)),
                "cameraHorizon": self._horizon_deg,
            },
            "lastAction": action,
            "lastActionSuccess": not error,
            "errorMessage": error,
            "actionReturn": result,
        }
        return make_event(frame, truth, camera, self.home, self._palette, metadata)


def _within_horizon(angle_deg: float) -> float:
    if not HORIZON_DEG[0] <= angle_deg <= HORIZON_DEG[1]:
        raise ActionError(
            f"the horizon must stay within {HORIZON_DEG[0]:g} and {HORIZON_DEG[1]:g} degrees, "
            f"not {angle_deg:g}"
        )
    return angle_deg
