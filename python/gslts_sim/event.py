"""Events, the results of the actions of the simulated robot, in the format of AI2-THOR."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gslts.core.camera import Camera
from gslts.core.frame import Labels, RgbdFrame
from gslts.types import Bools, Bytes, Floats32, Ints32
from gslts_sim.home import Home, HomeObject, yaw_of
from gslts_sim.raycast import View

Color = tuple[int, int, int]
VISIBILITY_M = 1.5
"""Maximum depth at which an object counts as visible in the metadata, m; as in AI2-THOR."""


@dataclass(frozen=True, eq=False)
class Event:
    """Frame, ground truth and metadata after an action.

    Args:
        frame: [H,W,3] uint8, sRGB.
        depth_frame: [H,W] float32, z in the camera frame, m; 0 where there is no measurement.
        instance_segmentation_frame: [H,W,3] uint8, a colour per object; black for background.
        semantic_segmentation_frame: [H,W,3] uint8, a colour per type; black for background.
        instances: [H,W] int32, row of the object in `metadata["objects"]`; -1 for background.
        color_to_object_id: Id or type of each colour in the two segmentation frames.
        metadata: `agent`, `objects`, `lastAction`, `lastActionSuccess`, `errorMessage` and
            `actionReturn`.
        observation: The frame with labels and the camera pose that the robot believes.
        camera: Camera at its true pose.
    """

    frame: Bytes
    depth_frame: Floats32
    instance_segmentation_frame: Bytes
    semantic_segmentation_frame: Bytes
    instances: Ints32
    color_to_object_id: dict[Color, str]
    metadata: dict[str, Any]
    observation: RgbdFrame
    camera: Camera

    @cached_property
    def instance_masks(self) -> dict[str, Bools]:
        """Masks [H,W] of the visible objects, by id."""
        ids = [obj["objectId"] for obj in self.metadata["objects"]]
        rows = np.unique(self.instances)
        return {ids[row]: self.instances == row for row in rows[rows >= 0].tolist()}


class Palette:
    """Colours of the objects and types of a home, the same when objects leave and return.

    Args:
        objs: All objects that are ever in the home.
    """

    def __init__(self, objs: Iterable[HomeObject]) -> None:
        objs = list(objs)
        ids = sorted(obj.id for obj in objs)
        types = sorted({obj.type for obj in objs} - set(ids))
        numbers = np.arange(1, len(ids) + len(types) + 1, dtype=np.int64)
        # An odd factor permutes the 24-bit numbers, so that neighbours get colours far apart.
        mixed = numbers * 10_368_889 % (1 << 24)
        colors = np.stack([mixed >> 16, mixed >> 8 & 255, mixed & 255], axis=1).tolist()
        self.color_of: dict[str, Color] = {
            name: (red, green, blue)
            for name, (red, green, blue) in zip(ids + types, colors, strict=True)
        }

    def paint(self, names: list[str], rows: Ints32) -> Bytes:
        """Return a segmentation frame.

        Args:
            names: Ids or types.
            rows: [H,W] int32, rows of `names`; -1 for background.

        Returns:
            [H,W,3] uint8, the colours of `names[rows]`; black for background.
        """
        colors = np.array([self.color_of[name] for name in names] + [(0, 0, 0)], np.uint8)
        return colors[rows]


def make_event(
    frame: RgbdFrame,
    truth: View,
    camera: Camera,
    home: Home,
    palette: Palette,
    metadata: dict[str, Any],
) -> Event:
    """Assemble the event of a frame.

    Args:
        frame: Simulated RGB-D frame.
        truth: Noise-free view from the same camera.
        camera: Camera at its true pose.
        home: The home in its current state.
        palette: Colours of the segmentation frames.
        metadata: Entries about the agent and the action; `objects` is added.
    """
    near = truth.instances[(truth.depth > 0) & (truth.depth < VISIBILITY_M)]
    visible = set(np.unique(near).tolist())
    types = tuple(obj.type for obj in home.objects)
    objects = [_metadata_of(obj, row in visible) for row, obj in enumerate(home.objects)]
    return Event(
        frame=frame.rgb,
        depth_frame=frame.depth,
        instance_segmentation_frame=palette.paint([o.id for o in home.objects], truth.instances),
        semantic_segmentation_frame=palette.paint([o.type for o in home.objects], truth.instances),
        instances=truth.instances,
        color_to_object_id={color: name for name, color in palette.color_of.items()},
        metadata={**metadata, "objects": objects},
        # A copy: the original keeps all samples of the rendering in memory.
        observation=replace(frame, labels=Labels(truth.instances.copy(), types)),
        camera=camera,
    )


def xyz(values: Any) -> dict[str, float]:
    """Return three numbers in AI2-THOR's notation.

    Args:
        values: x, y and z.
    """
    x, y, z = values
    return {"x": float(x), "y": float(y), "z": float(z)}


def _metadata_of(obj: HomeObject, visible: bool) -> dict[str, Any]:
    low, high = obj.box_in_world
    corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, 8).T
    return {
        "objectId": obj.id,
        "objectType": obj.type,
        "position": xyz(obj.world_from_object[:3, 3]),
        "rotation": xyz((0, 0, np.rad2deg(yaw_of(obj)))),
        "axisAlignedBoundingBox": {
            "center": xyz((low + high) / 2),
            "size": xyz(high - low),
            "cornerPoints": corners.tolist(),
        },
        "visible": visible,
        "pickupable": obj.movable,
        "receptacle": obj.receptacle,
        "parentReceptacles": None if obj.parent is None else [obj.parent],
    }
