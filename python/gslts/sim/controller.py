"""A robot in a simulated home, driven by the verbs of AI2-THOR (Kolve et al. 2017).

Actions, their arguments and the metadata bear AI2-THOR's names, but all coordinates are those of
the project: world with z up, right-handed, metres. The agent's rotation is its yaw about z in
degrees, from x to y; RotateRight makes it smaller.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gslts.camera import Camera, camera_from_fov, look_at
from gslts.frame import RgbdFrame
from gslts.sim import changes
from gslts.sim.event import Event, Palette, make_event, xyz
from gslts.sim.home import Floats, Home, HomeObject
from gslts.sim.raycast import RayCaster
from gslts.sim.sensor import Sensor, SensorNoise
from gslts.sim.walkable import WalkableFloor, walkable_floor

GRID_M = 0.25
ROTATE_STEP_DEG = 90.0
LOOK_STEP_DEG = 30.0
HORIZON_DEG = (-30.0, 60.0)
"""Least and greatest angle of the camera below the horizon."""
BODY_RADIUS_M = 0.2
BODY_HEIGHT_M = 1.2
CAMERA_HEIGHT_M = 1.5
FOV_RAD = np.pi / 2
"""Horizontal field of view."""

_MOVES_DEG = {"MoveAhead": 0.0, "MoveLeft": 90.0, "MoveBack": 180.0, "MoveRight": -90.0}


class ActionError(Exception):
    """An action that cannot be done, and why."""


class Controller:
    """A home and a robot in it, which together change by actions.

    Args:
        home: Where the robot is; it starts at the reachable place nearest to the middle.
        width: Of the images, px.
        height: Of the images, px.
        fov_rad: Horizontal field of view of the camera, rad.
        noise: Of the camera: a model, or the name of a preset.
        seed: Of the noise of this visit.

    Raises:
        ValueError: There is no floor on which the robot can stand, or no such preset.
    """

    def __init__(
        self,
        home: Home,
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
        self._palette = Palette(home)
        self._aside: dict[str, HomeObject] = {}
        self._set_home(home)
        places = self.reachable_positions()
        if len(places) == 0:
            raise ValueError(f"Controller: {home.name}: the robot can stand nowhere")
        middle = home.space.box.mean(axis=0)[:2]
        self._position = places[np.argmin(np.linalg.norm(places - middle, axis=1))]
        self._yaw_deg, self._horizon_deg = 0.0, 0.0
        self._last_pose: Floats | None = None
        self._last_event: Event | None = None

    @property
    def home(self) -> Home:
        """The home as it is now."""
        return self._home

    @property
    def last_event(self) -> Event:
        """That of the last step, or of a first look."""
        return self.step("Pass") if self._last_event is None else self._last_event

    def step(self, action: str, **arguments: Any) -> Event:
        """Does one action, or says in the metadata why not; then looks.

        Args:
            action: One of MoveAhead, MoveBack, MoveLeft, MoveRight (`moveMagnitude`, m),
                RotateLeft, RotateRight, LookUp, LookDown (`degrees`), Teleport (`position` with x
                and y, `rotation` in degrees, `horizon`), GetReachablePositions, Pass,
                InitialRandomSpawn (`randomSeed`, `numPlacementAttempts`), DisableObject and
                EnableObject (`objectId`), PlaceObjectAtPoint (`objectId`, `position` with x, y and
                z, where the middle of its underside comes, `rotation` in degrees).
            arguments: Of the action.

        Raises:
            ValueError: There is no such action, or it has no such argument.
        """
        error, result = "", None
        try:
            result = self.act(action, **arguments)
        except ActionError as reason:
            error = str(reason)
        self._last_event = self._look(action, error, result)
        return self._last_event

    def act(self, action: str, **arguments: Any) -> Any:
        """Does one action without a look.

        Args:
            action: As in `step`.
            arguments: Of the action.

        Returns:
            What the action returns, such as places.

        Raises:
            ActionError: It cannot be done.
            ValueError: There is no such action, or it has no such argument.
        """
        method = _ACTIONS.get(action)
        if method is None:
            raise ValueError(
                f"Controller: action must be one of {', '.join(_ACTIONS)}, got {action!r}"
            )
        try:
            return method(self, action, **arguments)
        except (ActionError, changes.ChangeError) as reason:
            raise ActionError(f"{action}: {reason}") from None
        except KeyError as reason:
            raise ValueError(f"Controller: {action}: {reason} is missing") from None
        except TypeError as reason:
            raise ValueError(f"Controller: {action}: {reason}") from None

    def observe(self) -> RgbdFrame:
        """What the camera sees now."""
        return self.step("Pass").observation

    def reachable_positions(self) -> Floats:
        """[P,2] places on the robot's grid that it can reach from where it is, x and y, m."""
        return self._floor.places(GRID_M)

    def move_towards(self, position: Floats, yaw_rad: float) -> bool:
        """Goes to the reachable place nearest to `position` and looks along `yaw_rad`."""
        places = self.reachable_positions()
        place = places[np.argmin(np.linalg.norm(places - position, axis=1))]
        event = self.step(
            "Teleport",
            position={"x": float(place[0]), "y": float(place[1])},
            rotation=float(np.rad2deg(yaw_rad)),
        )
        return bool(event.metadata["lastActionSuccess"])

    def _set_home(self, home: Home) -> None:
        self._home, self._floor = home, floor_of(home)
        self._caster: RayCaster | None = None  # Made when it is needed: many changes may follow.

    def _move(self, action: str, *, moveMagnitude: float = GRID_M) -> None:
        angle = np.deg2rad(self._yaw_deg + _MOVES_DEG[action])
        step = moveMagnitude * np.array([np.cos(angle), np.sin(angle)])
        pieces = max(2, int(np.ceil(abs(moveMagnitude) / self._floor.cell_m)) + 1)
        for share in np.linspace(0, 1, pieces)[1:]:
            if not self._floor.can_stand(self._position + share * step):
                raise ActionError(f"the way of {moveMagnitude:g} m is blocked")
        self._position = self._position + step

    def _rotate(self, action: str, *, degrees: float = ROTATE_STEP_DEG) -> None:
        turn = degrees if action == "RotateLeft" else -degrees
        self._yaw_deg = (self._yaw_deg + turn) % 360

    def _tilt(self, action: str, *, degrees: float = LOOK_STEP_DEG) -> None:
        horizon = self._horizon_deg + (degrees if action == "LookDown" else -degrees)
        if not HORIZON_DEG[0] <= horizon <= HORIZON_DEG[1]:
            raise ActionError(
                f"the horizon must stay within {HORIZON_DEG[0]:g} and "
                f"{HORIZON_DEG[1]:g} degrees, not {horizon:g}"
            )
        self._horizon_deg = horizon

    def _teleport(
        self,
        _action: str,
        *,
        position: dict[str, float] | None = None,
        rotation: float | None = None,
        horizon: float | None = None,
    ) -> None:
        place = self._position
        if position is not None:
            place = np.array([position["x"], position["y"]], np.float64)
        if not self._floor.can_stand(place):
            raise ActionError(f"the robot cannot stand at ({place[0]:g}, {place[1]:g})")
        if horizon is not None and not HORIZON_DEG[0] <= horizon <= HORIZON_DEG[1]:
            raise ActionError(f"horizon {horizon:g} is out of range")
        self._position, self._last_pose = place, None  # Nobody sees the way of a teleport.
        self._yaw_deg = self._yaw_deg if rotation is None else rotation % 360
        self._horizon_deg = self._horizon_deg if horizon is None else horizon

    def _get_reachable_positions(self, _action: str) -> list[dict[str, float]]:
        height = float(self._home.space.box[0, 2])
        return [{"x": float(x), "y": float(y), "z": height} for x, y in self.reachable_positions()]

    def _pass(self, _action: str) -> None:
        pass

    def _initial_random_spawn(
        self,
        _action: str,
        *,
        randomSeed: int = 0,
        numPlacementAttempts: int = 5,
    ) -> None:
        self._change(changes.spawn_randomly(self._home, randomSeed, numPlacementAttempts))

    def _disable_object(self, _action: str, *, objectId: str) -> None:
        before = self._home
        self._change(changes.disable(before, objectId))
        self._aside[objectId] = before[objectId]

    def _enable_object(self, _action: str, *, objectId: str) -> None:
        if objectId not in self._aside:
            there = "is there already" if objectId in self._home else "was never there"
            raise ActionError(f"{objectId} {there}")
        self._change(changes.enable(self._home, self._aside[objectId]))
        del self._aside[objectId]

    def _place_object_at_point(
        self,
        _action: str,
        *,
        objectId: str,
        position: dict[str, float],
        rotation: float | None = None,
    ) -> None:
        point = np.array([position[axis] for axis in "xyz"], np.float64)
        self._change(changes.place(self._home, objectId, point, rotation))

    def _change(self, home: Home) -> None:
        """Takes over a changed home, unless something would stand where the robot is."""
        if not floor_of(home).can_stand(self._position):
            raise ActionError("the robot stands in the way")
        self._set_home(home)

    def _look(self, action: str, error: str, result: Any) -> Event:
        camera = robot_camera(
            self._home, self._position, self._yaw_deg, self._horizon_deg, self._size, self._fov_rad
        )
        if self._caster is None:
            self._caster = RayCaster(self._sensor.lit(self._home))
        frame, truth = self._sensor.take(self._caster, camera, self._frames, self._last_pose)
        self._frames += 1
        self._last_pose = camera.world_from_camera
        metadata = {
            "agent": {
                "position": xyz((*self._position, self._home.space.box[0, 2])),
                "rotation": xyz((0, 0, self._yaw_deg)),
                "cameraHorizon": self._horizon_deg,
            },
            "lastAction": action,
            "lastActionSuccess": not error,
            "errorMessage": error,
            "actionReturn": result,
        }
        return make_event(frame, truth, self._home, self._palette, metadata)


def robot_camera(
    home: Home,
    position: Floats,
    yaw_deg: float,
    horizon_deg: float,
    size: tuple[int, int],
    fov_rad: float = FOV_RAD,
) -> Camera:
    """The robot's camera.

    Args:
        home: Whose floor the robot stands on.
        position: (2,) x and y, m.
        yaw_deg: From x to y, degrees.
        horizon_deg: Below the horizon, degrees.
        size: Width and height, px.
        fov_rad: Horizontal field of view, rad.
    """
    yaw, down = np.deg2rad(yaw_deg), np.deg2rad(horizon_deg)
    eye = np.array([*position, home.space.box[0, 2] + CAMERA_HEIGHT_M])
    ahead = (np.cos(yaw) * np.cos(down), np.sin(yaw) * np.cos(down), -np.sin(down))
    return camera_from_fov(*size, fov_rad, look_at(eye, eye + ahead))


def floor_of(home: Home) -> WalkableFloor:
    """Where the robot can be in a home."""
    return walkable_floor(home, home.space, BODY_RADIUS_M, BODY_HEIGHT_M)


_ACTIONS: dict[str, Any] = {
    **dict.fromkeys(_MOVES_DEG, Controller._move),
    **dict.fromkeys(("RotateLeft", "RotateRight"), Controller._rotate),
    **dict.fromkeys(("LookUp", "LookDown"), Controller._tilt),
    "Teleport": Controller._teleport,
    "GetReachablePositions": Controller._get_reachable_positions,
    "Pass": Controller._pass,
    "InitialRandomSpawn": Controller._initial_random_spawn,
    "DisableObject": Controller._disable_object,
    "EnableObject": Controller._enable_object,
    "PlaceObjectAtPoint": Controller._place_object_at_point,
}
