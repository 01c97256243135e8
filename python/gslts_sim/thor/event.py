"""Conversion of AI2-THOR's events to the project's frames, cameras and objects.

The functions take an `ai2thor.server.Event`, whose own methods have already turned Unity's images,
bottom row first, upside down: row 0 is the top. See `gslts_sim.thor.frame` for the coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera, look_at
from gslts.core.frame import RgbdFrame
from gslts.types import Floats, Ints32
from gslts_sim.robot_body import camera_direction
from gslts_sim.thor.frame import in_world, yaw_in_world

NEAR_PLANE_M, FAR_PLANE_M = 0.1, 20.0
"""Clipping planes of the agent's camera, m; the defaults of `ai2thor.server.Server`."""


@dataclass(frozen=True, eq=False)
class ThorObject:
    """An object of a scene of AI2-THOR.

    Args:
        id: Such as `Mug|+01.20|+00.90|-00.35`.
        type: Such as `Mug`.
        box: [2,3] lower and upper corner of the axis-aligned box around it, in the world, m.
        visible: Whether the agent sees it within the visibility distance.
        movable: Whether the agent can carry, push or pull it.
        parents: Ids of the receptacles that it is in or on.
    """

    id: str
    type: str
    box: Floats
    visible: bool
    movable: bool
    parents: tuple[str, ...]


def camera_of(event: Any) -> Camera:
    """Return the agent's camera.

    Args:
        event: An `ai2thor.server.Event`.

    Raises:
        ValueError: The metadata has no pose or field of view.
    """
    agent = _require(event.metadata, "agent")
    eye = in_world(_require(event.metadata, "cameraPosition"))
    yaw = yaw_in_world(_require(_require(agent, "rotation"), "y"))
    direction = camera_direction(yaw, np.deg2rad(_require(agent, "cameraHorizon")))
    width, height = event.screen_width, event.screen_height
    # Unity's fieldOfView is always the vertical one.
    focal_px = 0.5 * height / np.tan(0.5 * np.deg2rad(_require(event.metadata, "fov")))
    return Camera(
        fx=focal_px,
        fy=focal_px,
        cx=0.5 * width,
        cy=0.5 * height,
        width=width,
        height=height,
        world_from_camera=look_at(eye, eye + direction),
    )


def frame_of(event: Any, near_m: float = NEAR_PLANE_M, far_m: float = FAR_PLANE_M) -> RgbdFrame:
    """Return the agent's RGB-D frame.

    Args:
        event: An `ai2thor.server.Event` with a depth image in metres.
        near_m: Near clipping plane of the agent's camera, m.
        far_m: Far clipping plane, m; there is no measurement at or beyond it.

    Raises:
        ValueError: An image, the pose or the field of view is missing.
    """
    rgb = _image(event.frame, "colour", "renderImage=True, headless=False")
    depth = _image(event.depth_frame, "depth", "renderDepthImage=True")
    # AI2-THOR's metres are z / far, Unity's Linear01Depth, times far - near: 0.5 % too short.
    depth = depth * np.float32(far_m / (far_m - near_m))
    depth[depth >= far_m * (1 - 1e-5)] = 0
    time_s = float(event.metadata.get("currentTime") or 0.0)
    return RgbdFrame(np.ascontiguousarray(rgb), depth, camera_of(event), time_s)


def objects_of(event: Any) -> list[ThorObject]:
    """Return the objects of the scene, in AI2-THOR's order.

    Args:
        event: An `ai2thor.server.Event`.

    Raises:
        ValueError: The metadata has no objects, or an object lacks a property.
    """
    return [_object_of(obj) for obj in _require(event.metadata, "objects")]


def instances_of(event: Any, objects: Sequence[ThorObject]) -> Ints32:
    """Return the object of each pixel.

    Args:
        event: An `ai2thor.server.Event` with an instance image.
        objects: Result of `objects_of`.

    Returns:
        [H,W] int32 indices of `objects`; -1 for anything else.

    Raises:
        ValueError: There is no instance image.
    """
    image = event.instance_segmentation_frame
    colors = _image(image, "instance", "renderInstanceSegmentation=True").astype(np.int32)
    index_of = {obj.id: index for index, obj in enumerate(objects)}
    # Classes and parts of the building have colours, too.
    index_of_code = {
        (red << 16) + (green << 8) + blue: index_of[name]
        for (red, green, blue), name in event.color_to_object_id.items()
        if name in index_of
    }
    codes, indices = np.unique(
        (colors[..., 0] << 16) + (colors[..., 1] << 8) + colors[..., 2], return_inverse=True
    )
    found = np.array([index_of_code.get(int(code), -1) for code in codes], np.int32)
    return found[indices].reshape(colors.shape[:2])


def _object_of(obj: Any) -> ThorObject:
    around = _require(obj, "axisAlignedBoundingBox")
    center = in_world(_require(around, "center"))
    half = 0.5 * in_world(_require(around, "size"))
    return ThorObject(
        id=_require(obj, "objectId"),
        type=_require(obj, "objectType"),
        box=np.stack([center - half, center + half]),
        visible=bool(_require(obj, "visible")),
        movable=bool(_require(obj, "pickupable") or _require(obj, "moveable")),
        parents=tuple(_require(obj, "parentReceptacles", may_be_none=True) or ()),
    )


def _require(metadata: Any, key: str, *, may_be_none: bool = False) -> Any:
    value = metadata.get(key)
    if key not in metadata or (value is None and not may_be_none):
        raise ValueError(
            f"AI2-THOR's event lacks the metadata {key!r}: is the scene initialized, and the build "
            "one of release 5?"
        )
    return value


def _image(image: Any, name: str, switch: str) -> NDArray[Any]:
    if image is None:
        raise ValueError(f"AI2-THOR's event lacks the {name} image: start the controller with "
                         f"{switch}")  # fmt: skip
    return np.asarray(image)
