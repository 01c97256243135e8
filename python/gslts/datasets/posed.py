"""Frames of a recording at other poses than those that it gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import product, relative
from gslts.datasets.dataset import Dataset, Frame
from gslts.types import Floats


@dataclass(frozen=True, eq=False)
class PosedFrame:
    """A frame on the disk at another pose.

    Args:
        frame: The frame.
        world_from_camera: [4,4] pose of its colour camera, m.
    """

    frame: Frame
    world_from_camera: Floats

    @property
    def name(self) -> str:
        """Name of the frame."""
        return self.frame.name

    @property
    def camera(self) -> Camera:
        """Intrinsics of the frame, at the pose."""
        return at_pose(self.frame.camera, self.world_from_camera)

    def read(self) -> RgbdFrame:
        """Read the images; see `gslts.datasets.dataset.Frame.read`."""
        read = self.frame.read()
        depth_camera = read.depth_camera
        if depth_camera is not None:
            beside = relative(read.camera.world_from_camera, depth_camera.world_from_camera)
            depth_camera = at_pose(depth_camera, product(self.world_from_camera, beside))
        camera = at_pose(read.camera, self.world_from_camera)
        return replace(read, camera=camera, depth_camera=depth_camera)


def with_poses(dataset: Dataset, poses: Mapping[str, Floats]) -> Dataset:
    """Return a recording at other poses.

    Args:
        dataset: Its own poses are not used.
        poses: World_from_camera [4,4] of frames, m, by name. Other frames are left out.
    """
    frames = (PosedFrame(f, poses[f.name]) for f in dataset.frames if f.name in poses)
    return replace(dataset, frames=tuple(frames), unposed=(), points=None)
