"""What an action of the simulated robot leads to, in AI2-THOR's words."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.core.frame import Labels, RgbdFrame
from gslts_sim.home import Home, HomeObject, yaw_of
from gslts_sim.raycast import View

Color = tuple[int, int, int]


VISIBILITY_M = 1.5
"""An object counts as visible if it is seen nearer than this, as in AI2-THOR."""


@dataclass(frozen=True, eq=False)
class Event:
    """What an action led to.

    Attributes:
        frame: [H,W,3] uint8, sRGB.
        depth_frame: [H,W] float32, z in the camera frame, m; 0 where there is no measurement.
        instance_segmentation_frame: [H,W,3] uint8, a colour for each object; black for nothing.
        semantic_segmentation_frame: [H,W,3] uint8, a colour for each type; black for nothing.
        instances: [H,W] int32, row of the object in `metadata["objects"]`; -1 for nothing.
        color_to_object_id: Whose colour is which in both: ids, and types.
        metadata: `agent`, `objects`, `lastAction`, `lastActionSuccess`, `errorMessage` and
            `actionReturn`.
        observation: The frame with its camera, as the rest of the project takes it.
        camera: Where the camera is in truth.
    """

    frame: NDArray[np.uint8]
    depth_frame: NDArray[np.float32]
    instance_segmentation_frame: NDArray[np.uint8]
    semantic_segmentation_frame: NDArray[np.uint8]
    instances: NDArray[np.int32]
    color_to_object_id: dict[Color, str]
    metadata: dict[str, Any]
    observation: RgbdFrame
    camera: Camera

    @cached_property
    def instance_masks(self) -> dict[str, NDArray[np.bool_]]:
        """[H,W] where each object is seen, by id; without those that are not."""
        ids = [thing["objectId"] for thing in self.metadata["objects"]]
        rows = np.unique(self.instances)
        return {ids[row]: self.instances == row for row in rows[rows >= 0].tolist()}


class Palette:
    """Colours for the objects and types of a home, which stay when objects go and come back."""

    def __init__(self, things: Iterable[HomeObject]) -> None:
        things = list(things)
        ids = sorted(thing.id for thing in things)
        types = sorted({thing.type for thing in things} - set(ids))
        numbers = np.arange(1, len(ids) + len(types) + 1, dtype=np.int64)
        # An odd factor permutes the 24-bit numbers, so that neighbours get colours far apart.
        mixed = numbers * 10_368_889 % (1 << 24)
        colors = np.stack([mixed >> 16, mixed >> 8 & 255, mixed & 255], axis=1).tolist()
        self.color_of: dict[str, Color] = {
            name: (red, green, blue)
            for name, (red, green, blue) in zip(ids + types, colors, strict=True)
        }

    def paint(self, names: list[str], rows: NDArray[np.int32]) -> NDArray[np.uint8]:
        """[H,W,3] the colours of `names[rows]`; black where the row is -1."""
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
    """The event of a look at a home from a camera; `metadata` gets its `objects`."""
    near = truth.instances[(truth.depth > 0) & (truth.depth < VISIBILITY_M)]
    visible = set(np.unique(near).tolist())
    types = tuple(thing.type for thing in home.objects)
    objects = [_metadata_of(thing, row in visible) for row, thing in enumerate(home.objects)]
    return Event(
        frame=frame.rgb,
        depth_frame=frame.depth,
        instance_segmentation_frame=palette.paint([o.id for o in home.objects], truth.instances),
        semantic_segmentation_frame=palette.paint([o.type for o in home.objects], truth.instances),
        instances=truth.instances,
        color_to_object_id={color: name for name, color in palette.color_of.items()},
        metadata={**metadata, "objects": objects},
        observation=replace(frame, labels=Labels(truth.instances, types)),
        camera=camera,
    )


def xyz(values: Any) -> dict[str, float]:
    """Three numbers as AI2-THOR writes them."""
    x, y, z = values
    return {"x": float(x), "y": float(y), "z": float(z)}


def _metadata_of(thing: HomeObject, visible: bool) -> dict[str, Any]:
    low, high = thing.box_in_world
    corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, 8).T
    return {
        "objectId": thing.id,
        "objectType": thing.type,
        "position": xyz(thing.world_from_object[:3, 3]),
        "rotation": xyz((0, 0, np.rad2deg(yaw_of(thing)))),
        "axisAlignedBoundingBox": {
            "center": xyz((low + high) / 2),
            "size": xyz(high - low),
            "cornerPoints": corners.tolist(),
        },
        "visible": visible,
        "pickupable": thing.movable,
        "receptacle": thing.receptacle,
        "parentReceptacles": None if thing.parent is None else [thing.parent],
    }
