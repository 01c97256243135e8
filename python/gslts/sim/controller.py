"""A robot in a simulated home, driven by the verbs of AI2-THOR (Kolve et al. 2017).

Actions, their arguments and the metadata bear AI2-THOR's names, but all coordinates are those of
the project: world with z up, right-handed, metres. The agent's rotation is its yaw about z in
degrees, from x to y; RotateRight makes it smaller.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.camera import Camera, camera_from_fov, look_at
from gslts.frame import RgbdFrame
from gslts.sim.home import Home, HomeObject, Room
from gslts.sim.raycast import RayCaster, View
from gslts.sim.sensor import Sensor, SensorNoise
from gslts.sim.walkable import WalkableFloor, walkable_floor

Floats = NDArray[np.float64]

GRID_M = 0.25
ROTATE_STEP_DEG = 90.0
LOOK_STEP_DEG = 30.0
HORIZON_DEG = (-30.0, 60.0)
"""Least and greatest angle of the camera below the horizon."""
BODY_RADIUS_M = 0.2
BODY_HEIGHT_M = 1.2
CAMERA_HEIGHT_M = 1.5
VISIBILITY_M = 1.5
"""An object counts as visible if it is seen nearer than this, as in AI2-THOR."""

_MOVES_DEG = {"MoveAhead": 0.0, "MoveLeft": 90.0, "MoveBack": 180.0, "MoveRight": -90.0}


@dataclass(frozen=True, eq=False)
class Event:
    """What an action led to.

    Attributes:
        frame: [H,W,3] uint8, sRGB.
        depth_frame: [H,W] float32, z in the camera frame, m; 0 where there is no measurement.
        instance_segmentation_frame: [H,W,3] uint8, a colour for each object; black for nothing.
        color_to_object_id: Whose colour is which.
        metadata: `agent`, `objects`, `lastAction`, `lastActionSuccess`, `errorMessage` and
            `actionReturn`.
        observation: The frame with its camera, as the rest of the project takes it.
    """

    frame: NDArray[np.uint8]
    depth_frame: NDArray[np.float32]
    instance_segmentation_frame: NDArray[np.uint8]
    color_to_object_id: dict[tuple[int, int, int], str]
    metadata: dict[str, Any]
    observation: RgbdFrame


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
        fov_rad: float = np.pi / 2,
        noise: SensorNoise | str = "none",
        seed: int = 0,
    ) -> None:
        self._size, self._fov_rad = (width, height), fov_rad
        self._sensor = Sensor(noise, seed)
        self._frames = 0
        self._set_home(home)
        places = self._grid_places()
        if len(places) == 0:
            raise ValueError(f"Controller: {home.name}: the robot can stand nowhere")
        middle = 0.5 * (self._floor_room.box[0, :2] + self._floor_room.box[1, :2])
        self._position = places[np.argmin(np.linalg.norm(places - middle, axis=1))]
        self._yaw_deg, self._horizon_deg = 0.0, 0.0
        self._last_pose: Floats | None = None
        self.last_event = self.step("Pass")

    @property
    def home(self) -> Home:
        """The home as it is now."""
        return self._home

    def step(self, action: str, **arguments: Any) -> Event:
        """Does one action, or says in the metadata why not; then looks.

        Args:
            action: One of MoveAhead, MoveBack, MoveLeft, MoveRight (`moveMagnitude`, m),
                RotateLeft, RotateRight, LookUp, LookDown (`degrees`), Teleport (`position` with x
                and y, `rotation` in degrees, `horizon`), GetReachablePositions and Pass.
            arguments: Of the action.

        Raises:
            ValueError: There is no such action, or it has no such argument.
        """
        method = _ACTIONS.get(action)
        if method is None:
            raise ValueError(f"Controller.step: action must be one of {', '.join(_ACTIONS)}, "
                             f"got {action!r}")  # fmt: skip
        error, result = "", None
        try:
            result = method(self, action, **arguments)
        except ActionError as reason:
            error = str(reason)
        except TypeError as reason:
            raise ValueError(f"Controller.step: {action}: {reason}") from None
        self.last_event = self._look(action, error, result)
        return self.last_event

    def observe(self) -> RgbdFrame:
        """What the camera sees now."""
        return self.step("Pass").observation

    def reachable_positions(self) -> Floats:
        """[P,2] places on the robot's grid that it can reach from where it is, x and y, m."""
        return self._grid_places()

    def move_towards(self, position: Floats, yaw_rad: float) -> bool:
        """Goes to the reachable place nearest to `position` and looks along `yaw_rad`."""
        places = self._grid_places()
        place = places[np.argmin(np.linalg.norm(places - position, axis=1))]
        event = self.step(
            "Teleport",
            position={"x": float(place[0]), "y": float(place[1])},
            rotation=float(np.rad2deg(yaw_rad)),
        )
        return bool(event.metadata["lastActionSuccess"])

    def _set_home(self, home: Home) -> None:
        self._home = home
        self._caster = RayCaster(home)
        corners = np.stack([room.box for room in home.rooms])
        box = np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
        self._floor_room = Room("all", box)
        self._floor: WalkableFloor = walkable_floor(
            home, self._floor_room, BODY_RADIUS_M, BODY_HEIGHT_M
        )

    def _can_stand(self, position: Floats) -> bool:
        column, row = np.rint((position - self._floor.origin) / self._floor.cell_m).astype(int)
        rows, columns = self._floor.largest.shape
        return bool(0 <= row < rows and 0 <= column < columns and self._floor.largest[row, column])

    def _grid_places(self) -> Floats:
        """[P,2] points of the grid of the home on which the robot can stand."""
        low, high = self._floor_room.box[:, :2]
        first = np.ceil(low / GRID_M) * GRID_M
        x, y = (np.arange(first[k], high[k], GRID_M) for k in range(2))
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return places[[self._can_stand(place) for place in places]]

    def _move(self, action: str, *, moveMagnitude: float = GRID_M) -> None:  # noqa: N803
        angle = np.deg2rad(self._yaw_deg + _MOVES_DEG[action])
        step = moveMagnitude * np.array([np.cos(angle), np.sin(angle)])
        pieces = max(2, int(np.ceil(abs(moveMagnitude) / self._floor.cell_m)) + 1)
        for share in np.linspace(0, 1, pieces)[1:]:
            if not self._can_stand(self._position + share * step):
                raise ActionError(f"{action}: the way of {moveMagnitude:g} m is blocked")
        self._position = self._position + step

    def _rotate(self, action: str, *, degrees: float = ROTATE_STEP_DEG) -> None:
        turn = degrees if action == "RotateLeft" else -degrees
        self._yaw_deg = (self._yaw_deg + turn) % 360

    def _tilt(self, action: str, *, degrees: float = LOOK_STEP_DEG) -> None:
        horizon = self._horizon_deg + (degrees if action == "LookDown" else -degrees)
        if not HORIZON_DEG[0] <= horizon <= HORIZON_DEG[1]:
            raise ActionError(
                f"{action}: the horizon must stay within {HORIZON_DEG[0]:g} and "
                f"{HORIZON_DEG[1]:g} degrees, not {horizon:g}"
            )
        self._horizon_deg = horizon

    def _teleport(
        self,
        action: str,
        *,
        position: dict[str, float] | None = None,
        rotation: float | None = None,
        horizon: float | None = None,
    ) -> None:
        place = self._position
        if position is not None:
            place = np.array([position["x"], position["y"]], np.float64)
        if not self._can_stand(place):
            raise ActionError(f"{action}: the robot cannot stand at ({place[0]:g}, {place[1]:g})")
        if horizon is not None and not HORIZON_DEG[0] <= horizon <= HORIZON_DEG[1]:
            raise ActionError(f"{action}: horizon {horizon:g} is out of range")
        self._position = place
        self._yaw_deg = self._yaw_deg if rotation is None else rotation % 360
        self._horizon_deg = self._horizon_deg if horizon is None else horizon

    def _get_reachable_positions(self, _action: str) -> list[dict[str, float]]:
        height = float(self._floor_room.box[0, 2])
        return [{"x": float(x), "y": float(y), "z": height} for x, y in self.reachable_positions()]

    def _pass(self, _action: str) -> None:
        pass

    def _camera(self) -> Camera:
        yaw, down = np.deg2rad(self._yaw_deg), np.deg2rad(self._horizon_deg)
        eye = np.array([*self._position, self._floor_room.box[0, 2] + CAMERA_HEIGHT_M])
        ahead = (np.cos(yaw) * np.cos(down), np.sin(yaw) * np.cos(down), -np.sin(down))
        return camera_from_fov(*self._size, self._fov_rad, look_at(eye, eye + ahead))

    def _look(self, action: str, error: str, result: Any) -> Event:
        camera = self._camera()
        frame, truth = self._sensor.take(self._caster, camera, self._frames, self._last_pose)
        self._frames += 1
        self._last_pose = camera.world_from_camera
        colors = _object_colors(len(self._home.objects))
        segmentation = np.where(
            (truth.instances >= 0)[..., None], colors[truth.instances], np.uint8(0)
        )
        metadata = {
            "agent": {
                "position": _xyz((*self._position, self._floor_room.box[0, 2])),
                "rotation": _xyz((0, 0, self._yaw_deg)),
                "cameraHorizon": self._horizon_deg,
            },
            "objects": self._object_metadata(truth),
            "lastAction": action,
            "lastActionSuccess": not error,
            "errorMessage": error,
            "actionReturn": result,
        }
        ids = [thing.id for thing in self._home.objects]
        by_color = {tuple(map(int, color)): name for color, name in zip(colors, ids, strict=True)}
        return Event(frame.rgb, frame.depth, segmentation, by_color, metadata, frame)

    def _object_metadata(self, truth: View) -> list[dict[str, Any]]:
        near = truth.instances[(truth.depth > 0) & (truth.depth < VISIBILITY_M)]
        visible = set(np.unique(near).tolist())
        return [
            _metadata_of(thing, index in visible) for index, thing in enumerate(self._home.objects)
        ]


_ACTIONS: dict[str, Any] = {
    **dict.fromkeys(_MOVES_DEG, Controller._move),
    **dict.fromkeys(("RotateLeft", "RotateRight"), Controller._rotate),
    **dict.fromkeys(("LookUp", "LookDown"), Controller._tilt),
    "Teleport": Controller._teleport,
    "GetReachablePositions": Controller._get_reachable_positions,
    "Pass": Controller._pass,
}


def _xyz(values: Any) -> dict[str, float]:
    x, y, z = values
    return {"x": float(x), "y": float(y), "z": float(z)}


def _metadata_of(thing: HomeObject, visible: bool) -> dict[str, Any]:
    low, high = thing.box_in_world
    corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, 8).T
    rotation = thing.world_from_object[:3, :3]
    yaw_deg = np.rad2deg(np.arctan2(rotation[1, 0], rotation[0, 0]))
    return {
        "objectId": thing.id,
        "objectType": thing.type,
        "position": _xyz(thing.world_from_object[:3, 3]),
        "rotation": _xyz((0, 0, yaw_deg)),
        "axisAlignedBoundingBox": {
            "center": _xyz((low + high) / 2),
            "size": _xyz(high - low),
            "cornerPoints": corners.tolist(),
        },
        "visible": visible,
        "pickupable": thing.movable,
        "receptacle": thing.receptacle,
        "parentReceptacles": None if thing.parent is None else [thing.parent],
    }


def _object_colors(count: int) -> NDArray[np.uint8]:
    """[count,3] colours that are all different, and none of them black."""
    # An odd factor permutes the 24-bit numbers, so that neighbours get colours far apart.
    mixed = (np.arange(1, count + 1, dtype=np.int64) * 10_368_889) % (1 << 24)
    return np.stack([mixed >> 16, mixed >> 8 & 255, mixed & 255], axis=1).astype(np.uint8)
