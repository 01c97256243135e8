"""Stand-in for Unity behind AI2-THOR's server, with a tiny scene, written from Unity's manual."""

import warnings
from typing import Any

import numpy as np

with warnings.catch_warnings():
    # Of ai2thor's own imports; the project has no say in them.
    warnings.simplefilter("ignore", DeprecationWarning)
    from ai2thor.controller import Controller
    from ai2thor.server import Server

NEAR_M, FAR_M = 0.1, 20.0
CAMERA_ABOVE_AGENT_M = 0.675
COLORS = {"Mug|1": [200, 10, 30], "Table|1": [5, 90, 250], "Mug": [1, 2, 3], "Ceiling": [7, 7, 7]}


def unity_rotation(yaw_deg: float, horizon_deg: float) -> np.ndarray:
    """[3,3] x_in_unity_world = R @ x_in_unity_camera: Quaternion.Euler(horizon, yaw, 0).

    Unity turns about x first, then about y; positive angles turn y to z and z to x.
    """
    y, x = np.deg2rad([yaw_deg, horizon_deg])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    return about_y @ about_x


class UnityStandIn(Server):
    """Server that shows each point as one pixel of an object and executes actions."""

    server_type = "FIFO"

    def __init__(self, width: int, height: int) -> None:
        super().__init__(width=width, height=height, timeout=1.0)
        self.width_px, self.height_px = width, height
        self.points: dict[str, np.ndarray] = {}
        self.agent = np.array([1.0, 0.9, -2.0])
        self.yaw_deg, self.horizon_deg, self.fov_deg = 0.0, 0.0, 60.0
        self.images = ("image", "image_depth", "image_ids")
        self.reachable = [(1.0, -2.0), (1.25, -2.0), (1.0, -1.75)]
        self.failure = ""
        self.actions: list[dict[str, Any]] = [{"action": "Pass", "sequenceId": 0}]
        self.extra_metadata: dict[str, Any] = {}

    @property
    def camera(self) -> np.ndarray:
        return self.agent + np.array([0, CAMERA_ABOVE_AGENT_M, 0])

    def start(self) -> None:
        self.started = True

    def stop(self) -> None:
        self.started = False

    def send(self, action: dict[str, Any]) -> None:
        self.sequence_id = action["sequenceId"] = action.get("sequenceId", self.sequence_id + 1)
        self.actions.append(action)
        if action["action"] == "Teleport":
            self.agent = np.array([action["position"][axis] for axis in "xyz"])
            self.yaw_deg = action["rotation"]["y"]

    def receive(self, timeout: float | None = None) -> Any:  # noqa: ARG002
        buffers = self.render()
        files = {name: [buffers[name].tobytes()] for name in self.images}
        whole = {"agents": [self.metadata()], "sequenceId": self.sequence_id, "activeAgentId": 0}
        return self.create_event(whole, files)

    def screen_point(self, point: np.ndarray) -> np.ndarray:
        """Camera.WorldToScreenPoint: px from the lower left corner, and z in the camera, m."""
        x, y, z = unity_rotation(self.yaw_deg, self.horizon_deg).T @ (point - self.camera)
        half = 0.5 * self.height_px / np.tan(np.deg2rad(self.fov_deg) / 2)
        return np.array(
            [0.5 * self.width_px + half * x / z, 0.5 * self.height_px + half * y / z, z]
        )

    def render(self) -> dict[str, np.ndarray]:
        """Return images with the bottom row first, as Unity's textures are."""
        size = (self.height_px, self.width_px)
        color = np.zeros((*size, 3), np.uint8)
        ids = np.full((*size, 4), 255, np.uint8)
        depth = np.full(size, FAR_M - NEAR_M, np.float32)
        for name, point in self.points.items():
            column, row, z = self.screen_point(point)
            if z > NEAR_M and 0 <= column < size[1] and 0 <= row < size[0]:
                place = int(row), int(column)
                color[place] = 255
                ids[place] = (*COLORS[name], 255)
                depth[place] = z / FAR_M * (FAR_M - NEAR_M)  # AI2-THOR's Depth.shader.
        return {"image": color, "image_depth": depth, "image_ids": ids}

    def metadata(self) -> dict[str, Any]:
        last = self.actions[-1]["action"]
        results = {
            "GetScenesInBuild": ["FloorPlan1_physics"],
            "Initialize": {"cameraNearPlane": NEAR_M, "cameraFarPlane": FAR_M},
            "GetReachablePositions": [xyz((x, self.agent[1], z)) for x, z in self.reachable],
        }
        return {
            "agent": {
                "position": xyz(self.agent),
                "rotation": xyz((0, self.yaw_deg, 0)),
                "cameraHorizon": self.horizon_deg,
            },
            "cameraPosition": xyz(self.camera),
            "fov": self.fov_deg,
            "screenWidth": self.width_px,
            "screenHeight": self.height_px,
            "sceneName": "FloorPlan1_physics",
            "objects": [
                thing("Table|1", (0, 0.4, 1), (2, 0.8, 1), moveable=True),
                thing("Mug|1", (0.5, 0.9, 1.25), (0.1, 0.2, 0.12), parent="Table|1"),
            ],
            "colors": [{"name": name, "color": color} for name, color in COLORS.items()],
            "depthFormat": "Meters",
            "thirdPartyCameras": [],
            "lastAction": last,
            "lastActionSuccess": not self.failure,
            "errorMessage": self.failure,
            "errorCode": "",
            "actionReturn": results.get(last),
            "currentTime": 1.5,
            **self.extra_metadata,
        }


class StandInController(Controller):
    """Return ai2thor's own controller, connected to the stand-in."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(start_unity=False, **arguments)

    def _build_server(self, host: str, port: int, width: int, height: int) -> None:  # noqa: ARG002
        if self.server is None:
            self.server = UnityStandIn(width, height)


def thing(
    name: str, center: tuple, size: tuple, *, moveable: bool = False, parent: str | None = None
) -> dict[str, Any]:
    return {
        "objectId": name,
        "objectType": name.split("|")[0],
        "axisAlignedBoundingBox": {"center": xyz(center), "size": xyz(size)},
        "visible": parent is not None,
        "pickupable": not moveable,
        "moveable": moveable,
        "parentReceptacles": None if parent is None else [parent],
    }


def xyz(values: Any) -> dict[str, float]:
    return dict(zip("xyz", map(float, values), strict=True))
