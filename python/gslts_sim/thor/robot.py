"""AI2-THOR (Kolve et al. 2017) as a robot of the project.

AI2-THOR is optional: `pip install 'gslts[thor]'`, then `pip install --no-deps ai2thor`. With its
dependencies it would install `opencv-python`, which overwrites the `cv2` of a headless OpenCV. Its
scenes are Unity builds of hundreds of MB, which need an X display with GLX (`Linux64`) or Vulkan
(`CloudRendering`).
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.types import Floats
from gslts_sim.actions import GRID_M
from gslts_sim.robot_body import HORIZON_DEG
from gslts_sim.thor.event import (
    FAR_PLANE_M,
    NEAR_PLANE_M,
    ThorObject,
    camera_of,
    frame_of,
    objects_of,
)
from gslts_sim.thor.frame import in_world, unity_from_world, unity_yaw_from_world

CHANGES = ("InitialRandomSpawn", "DisableObject", "EnableObject", "PlaceObjectAtPoint")
"""Actions that change the scene and have no other coordinates than a position."""


class ThorController(Protocol):
    """The part of `ai2thor.controller.Controller` that is used."""

    last_event: Any

    def step(self, action: Any = None, **action_args: Any) -> Any:
        """Execute an action.

        Args:
            action: Its name.
            **action_args: Its arguments.

        Returns:
            An `ai2thor.server.Event`.
        """
        ...


class ThorRobot:
    """The agent of AI2-THOR as a `gslts.core.robot.Robot`, in the coordinates of the project.

    Args:
        controller: Initialized, with `renderDepthImage=True` and depth in metres, its default.
        near_m: Near clipping plane of the agent's camera, m.
        far_m: Far clipping plane of the agent's camera, m.
    """

    def __init__(
        self, controller: ThorController, near_m: float = NEAR_PLANE_M, far_m: float = FAR_PLANE_M
    ) -> None:
        self._controller = controller
        self._planes_m = (near_m, far_m)

    @property
    def last_event(self) -> Any:
        """The last `ai2thor.server.Event`; `gslts_sim.thor.event` converts it."""
        return self._controller.last_event

    def observe(self) -> RgbdFrame:
        """Take a frame at the current pose.

        Raises:
            ValueError: The controller renders no depth, or the scene is not initialized.
        """
        return frame_of(self._controller.step(action="Pass"), *self._planes_m)

    def pose(self) -> Floats:
        """Return [4,4] world_from_camera as of the last action, m.

        Raises:
            ValueError: The scene is not initialized.
        """
        return camera_of(self._controller.last_event).world_from_camera

    def objects(self) -> list[ThorObject]:
        """Return the objects of the scene in their current state."""
        return objects_of(self._controller.step(action="Pass"))

    def reachable_positions(self) -> Floats:
        """Return the grid positions [P,2] that the agent can reach from here, x and y, m.

        Raises:
            RuntimeError: AI2-THOR's action failed.
        """
        return self._reachable_points()[:, :2]

    def move_towards(
        self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """Teleport to the reachable grid position nearest to a position.

        Args:
            position: (2,) x and y, m.
            yaw_rad: Yaw after the move, rad.
            pitch_rad: Angle of the camera below the horizon, rad, clipped to its range; None keeps
                it.

        Returns:
            Whether the agent moved.
        """
        points = self._reachable_points()
        if len(points) == 0:
            return False
        nearest = np.argmin(np.linalg.norm(points[:, :2] - position, axis=1))
        horizon = {}
        if pitch_rad is not None:
            horizon = {"horizon": float(np.clip(np.rad2deg(pitch_rad), *HORIZON_DEG))}
        event = self._controller.step(
            action="Teleport",
            position=unity_from_world(points[nearest]),
            **horizon,
            rotation={"x": 0.0, "y": unity_yaw_from_world(yaw_rad), "z": 0.0},
        )
        return bool(event.metadata["lastActionSuccess"])

    def step(self, action: str, **arguments: Any) -> Any:
        """Change the scene; a failure is reported in the event's metadata.

        Args:
            action: InitialRandomSpawn (`randomSeed`, ...), DisableObject, EnableObject (`objectId`)
                or PlaceObjectAtPoint (`objectId`, `position`).
            arguments: As in AI2-THOR, but `position` is (3,) in the world, m.

        Returns:
            The `ai2thor.server.Event`, with `lastActionSuccess` and `errorMessage`.

        Raises:
            ValueError: The action, an argument or the object is unknown.
        """
        if action not in CHANGES:
            raise ValueError(f"ThorRobot.step: action must be one of {', '.join(CHANGES)}, "
                             f"got {action!r}")  # fmt: skip
        if "rotation" in arguments:
            raise ValueError(f"ThorRobot.step: {action}: rotation is not supported")
        if "position" in arguments:
            arguments["position"] = unity_from_world(arguments["position"])
        return self._controller.step(action=action, **arguments)

    def _reachable_points(self) -> Floats:
        """Return the reachable positions [P,3] in the world, m."""
        metadata = self._controller.step(action="GetReachablePositions").metadata
        if not metadata["lastActionSuccess"]:
            raise RuntimeError(f"ThorRobot: GetReachablePositions: {metadata['errorMessage']}")
        return np.array([in_world(p) for p in metadata["actionReturn"]]).reshape(-1, 3)


def start_thor(
    scene: str,
    *,
    width: int = 640,
    height: int = 480,
    fov_deg: float = 60.0,
    platform: str | None = None,
    x_display: str | None = None,
    executable: Path | str | None = None,
    download: bool = False,
) -> ThorRobot:
    """Start AI2-THOR in one of its scenes, or report what is missing.

    Args:
        scene: Such as `FloorPlan1`.
        width: Of the images, px.
        height: Of the images, px.
        fov_deg: Vertical field of view of the camera, degrees.
        platform: `Linux64`, which needs an X display, or `CloudRendering`, which needs Vulkan; None
            for the former if there is a display or an `executable`.
        x_display: Such as `:0`; None for the environment's DISPLAY.
        executable: Of a build outside of AI2-THOR's own folder; for `Linux64`.
        download: Whether a missing build may be downloaded.

    Raises:
        ImportError: The package ai2thor, or one that it needs, is not installed.
        ValueError: The platform is not one of the two, or not that of the executable.
        FileNotFoundError: The build is missing.
        RuntimeError: The display or Vulkan is missing, or the build cannot be downloaded.
    """
    display = x_display or os.environ.get("DISPLAY")
    chosen = platform or ("Linux64" if display or executable else "CloudRendering")
    if chosen not in ("Linux64", "CloudRendering"):
        raise ValueError(
            f"start_thor: platform must be Linux64 or CloudRendering, got {platform!r}"
        )
    if executable is not None and chosen != "Linux64":
        raise ValueError("start_thor: platform must be Linux64 where an executable is given")
    try:
        import ai2thor.controller
        import ai2thor.platform
    except ImportError as reason:
        raise ImportError(
            f"start_thor: {reason}: pip install 'gslts[thor]', then pip install --no-deps ai2thor "
            "(with its dependencies its opencv-python overwrites a headless OpenCV)"
        ) from reason
    _require_build(chosen, executable, download)
    system = ai2thor.platform.STR_PLATFORM_MAP[chosen]
    request = ai2thor.platform.Request("Linux", width, height, display, headless=False)
    if missing := system.validate(request):
        raise RuntimeError(f"start_thor: {chosen}: {'; '.join(map(str.strip, missing))} "
                           f"({system.dependency_instructions(request).strip()})")  # fmt: skip
    controller = ai2thor.controller.Controller(
        scene=scene,
        width=width,
        height=height,
        fieldOfView=fov_deg,
        gridSize=GRID_M,
        snapToGrid=True,
        renderDepthImage=True,
        renderInstanceSegmentation=True,
        platform=system,
        x_display=x_display,
        local_executable_path=None if executable is None else str(executable),
    )
    server = controller.server
    return ThorRobot(controller, server.camera_near_plane, server.camera_far_plane)


def _require_build(platform: str, executable: Path | str | None, download: bool) -> None:
    """Raise unless the build is on the disk, or may be and can be downloaded."""
    import ai2thor.build

    if executable is not None:
        if not Path(executable).is_file():
            raise FileNotFoundError(f"start_thor: executable: there is no file {executable}")
        return
    releases = Path.home() / ".ai2thor" / "releases"  # As in ai2thor.controller.Controller.
    build = ai2thor.build.Build(platform, ai2thor.build.COMMIT_ID, False, str(releases))
    folder = Path(build.base_dir)
    if folder.is_dir():
        for part in (build.executable_path, build.metadata_path):
            if not Path(part).is_file():
                raise FileNotFoundError(
                    f"start_thor: the AI2-THOR build in {folder} lacks {Path(part).name}: remove "
                    "the folder and start with download=True"
                )
        return
    if not download:
        raise FileNotFoundError(
            f"start_thor: there is no AI2-THOR build {build.name} in {releases}: start with "
            "download=True to fetch it (hundreds of MB), or with executable= if it is elsewhere"
        )
    try:
        exists = build.exists()
    except OSError as reason:  # Base class of the exceptions of requests.
        raise RuntimeError(
            f"start_thor: cannot reach {build.url} ({type(reason).__name__}) to download it"
        ) from reason
    if not exists:
        raise RuntimeError(f"start_thor: there is no build at {build.url}")
