"""Pinhole cameras and their poses."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gslts._core.map import Camera, camera_from_fov, look_at
from gslts.core.se3 import transform
from gslts.types import Floats

__all__ = [
    "Camera",
    "TrainingCamera",
    "at_pose",
    "camera_from_fov",
    "downscale",
    "look_at",
    "new_viewpoints",
    "resize",
    "shift_origin",
    "unproject",
]


NEW_VIEWPOINT_M, NEW_VIEWPOINT_RAD = 0.4, np.deg2rad(20)
"""Distance and angle between viewing directions up to which two cameras show much the same."""


class TrainingCamera(Camera):
    """Camera of a frame from which a version of a map was made.

    Args:
        camera: Intrinsics and pose.
        next_id: `next_id` of that version: Gaussians with this id or a greater one are newer than
            the frame, and so may be what they show.

    Attributes:
        next_id: See above.
    """

    def __init__(self, camera: Camera, next_id: int) -> None:
        super().__init__(
            fx=camera.fx,
            fy=camera.fy,
            cx=camera.cx,
            cy=camera.cy,
            width=camera.width,
            height=camera.height,
            world_from_camera=camera.world_from_camera,
        )
        self.next_id = next_id

    def __reduce__(self) -> tuple[type[TrainingCamera], tuple[Camera, int]]:
        """Return what a copy in another process is made of."""
        return TrainingCamera, (at_pose(self, self.world_from_camera), self.next_id)


def at_pose(camera: Camera, world_from_camera: Floats) -> Camera:
    """Return a camera with the same intrinsics at another pose.

    Args:
        camera: Gives the intrinsics.
        world_from_camera: [4,4], rigid, m.

    Raises:
        ValueError: The pose is not rigid.
    """
    return Camera(
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        width=camera.width,
        height=camera.height,
        world_from_camera=world_from_camera,
    )


def shift_origin(camera: Camera, origin: Floats) -> Camera:
    """Return the camera in a world frame whose origin is moved.

    Args:
        camera: In the old frame.
        origin: (3,) origin of the new frame in the old one, such as `GaussianMap.origin`, m.
    """
    pose = camera.world_from_camera
    pose[:3, 3] -= origin
    return at_pose(camera, pose)


def downscale(camera: Camera, divisor: int) -> Camera:
    """Return the camera of a smaller image.

    Args:
        camera: Of the full image.
        divisor: Number by which width and height are divided, rounded down.
    """
    return Camera(
        fx=camera.fx / divisor,
        fy=camera.fy / divisor,
        cx=camera.cx / divisor,
        cy=camera.cy / divisor,
        width=camera.width // divisor,
        height=camera.height // divisor,
        world_from_camera=camera.world_from_camera,
    )


def resize(camera: Camera, width_px: int) -> Camera:
    """Return the camera of an image of another width, and a height in proportion.

    Args:
        camera: Of the image.
        width_px: Of the other image.
    """
    scale = width_px / camera.width
    return Camera(
        fx=scale * camera.fx,
        fy=scale * camera.fy,
        cx=scale * camera.cx,
        cy=scale * camera.cy,
        width=width_px,
        height=max(1, round(scale * camera.height)),
        world_from_camera=camera.world_from_camera,
    )


def unproject(camera: Camera, pixels: Floats, depths_m: Floats) -> Floats:
    """Return the points in the world that pixels of known depth show.

    Args:
        camera: At world_from_camera.
        pixels: [P,2] positions in the image, px, pixel centres at +0.5.
        depths_m: [P] z in the camera frame, m.

    Returns:
        [P,3] in the world frame, m.
    """
    x = (pixels[:, 0] - camera.cx) / camera.fx
    y = (pixels[:, 1] - camera.cy) / camera.fy
    in_camera = np.column_stack([x, y, np.ones(len(pixels))]) * depths_m[:, None]
    return transform(camera.world_from_camera, in_camera)


def new_viewpoints(
    known: Iterable[Camera],
    more: Iterable[Camera],
    distance_m: float = NEW_VIEWPOINT_M,
    angle_rad: float = NEW_VIEWPOINT_RAD,
) -> list[bool]:
    """Select cameras that differ from all known cameras and from those selected before.

    Bounds their number by the number of viewpoints in a home, however often a robot returns.

    Args:
        known: Cameras of earlier frames.
        more: Cameras of new frames.
        distance_m: A camera is known if it is nearer than this to another one, m,
        angle_rad: and its viewing direction differs by less than this, rad.

    Returns:
        For each camera of `more`, whether it is a new viewpoint.
    """
    poses = [camera.world_from_camera for camera in known]
    new = []
    for camera in more:
        pose = camera.world_from_camera
        others = np.array(poses).reshape(-1, 4, 4)
        metres = np.linalg.norm(others[:, :3, 3] - pose[:3, 3], axis=1)
        turns_rad = np.arccos(np.clip(others[:, :3, 2] @ pose[:3, 2], -1, 1))
        new.append(not ((metres < distance_m) & (turns_rad < angle_rad)).any())
        if new[-1]:
            poses.append(pose)
    return new
