"""Frames whose images are no image files of their own: parts of a file, or special formats."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.datasets.dataset import reason_of
from gslts.io.image_files import decode_rgb
from gslts.types import Floats32


@dataclass(frozen=True, eq=False)
class PackedFrame:
    """A frame that functions read.

    Args:
        name: Unique name.
        source: File and position of the frame, for messages.
        camera: Intrinsics and pose of the colour image.
        read_rgb: Reads the bytes of a JPEG or PNG file.
        read_depth: Reads depth [H',W'] float32, m; 0 where there is no measurement.
        depth_camera: Intrinsics and pose of the depth image; None if it is registered.
        time_s: Time stamp, s.
    """

    name: str
    source: str
    camera: Camera
    read_rgb: Callable[[], bytes]
    read_depth: Callable[[], Floats32]
    depth_camera: Camera | None = None
    time_s: float = 0.0

    def read(self) -> RgbdFrame:
        """Read the images; see `gslts.datasets.dataset.Frame.read`."""
        try:
            rgb = decode_rgb(self.read_rgb())
            depth = self.read_depth()
            return RgbdFrame(rgb, depth, self.camera, self.time_s, self.depth_camera)
        except ValueError as error:
            raise ValueError(f"{self.source}: {reason_of(error)}") from None
