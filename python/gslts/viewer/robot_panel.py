"""Part of the panel for a robot that works in the map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gslts.core.camera import Camera
from gslts.io.images import RgbImage, depth_image, depth_range, error_image, to_rgb8
from gslts.rendering.rasterizer import RenderOptions, render
from gslts.types import Floats
from gslts.viewer.live import LiveFrame
from gslts.viewer.overlay import ROBOT, Overlay
from gslts.viewer.panel_text import EMPTY, paragraphs
from gslts.viewer.viewed_map import ViewedMap

BRIGHT_ERROR = 0.25
"""Mean difference of the channels that the image of differences shows brightest, 0 to 1."""
LEGEND = "Above: camera, map. Below: where they differ, depth of the map."
"""Describes the image."""
THREADS = 1
"""Threads of a rendering: the robot needs the others."""


class RobotPanel:
    """Shows the newest frame of a robot beside the map, where the robot is, and where it was.

    Args:
        gui: Of a page.
        viewed: The map.
        overlay: Of the page.
        look_at: Moves the page's camera: arguments are (3,) position and target in the world, m.
    """

    def __init__(
        self,
        gui: Any,
        viewed: ViewedMap,
        overlay: Overlay,
        look_at: Callable[[Floats, Floats], None],
    ) -> None:
        self._map, self._overlay, self._look_at = viewed, overlay, look_at
        with gui.add_folder("Robot", order=0):
            self._lines = gui.add_html("")
            self._image = gui.add_image(EMPTY, format="jpeg")
            self._legend = gui.add_html("")
            self._rides = gui.add_checkbox("Look through its camera", False)

    def show(self, live: LiveFrame, path: Sequence[Floats]) -> None:
        """Show a frame.

        Args:
            live: The frame.
            path: (3,) positions of the robot so far, the newest last, m.
        """
        camera = live.camera
        self._overlay.clear("robot")
        if len(path) > 1:
            self._overlay.path("robot", np.array(path), ROBOT)
        self._image.image = live.rgb if camera is None else self._beside_map(live.rgb, camera)
        self._legend.content = "" if camera is None else paragraphs([LEGEND])
        self._lines.content = paragraphs(live.lines)
        if camera is None:
            return
        self._overlay.cameras("robot", [camera], ROBOT)
        if self._rides.value:
            pose = camera.world_from_camera
            self._look_at(pose[:3, 3], pose[:3, 3] + pose[:3, 2])

    def _beside_map(self, rgb: RgbImage, camera: Camera) -> RgbImage:
        """Return the grid of images that the legend describes."""
        gaussians = self._map.gaussians(self._map.newest)
        rendered = render(gaussians, camera, RenderOptions(threads=THREADS))
        map_rgb = to_rgb8(rendered.rgb)
        difference = error_image(rgb, map_rgb, BRIGHT_ERROR)
        depth = depth_image(rendered.depth, depth_range(rendered.depth))
        return np.vstack([np.hstack([rgb, map_rgb]), np.hstack([difference, depth])])
