"""Images of a map behind the Gaussians of a page: one to begin with, and two with a divider."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gslts.core.camera import Camera, camera_from_fov
from gslts.core.se3 import pose_distance, rotation_of_quat
from gslts.io.images import RgbImage, to_rgb8
from gslts.rendering.rasterizer import render
from gslts.types import Floats
from gslts.viewer.viewed_map import ViewedMap

WIDTH_PX = 800
"""Width of the image, which the browser scales to its window: 0.1 to 0.3 s on two cores."""
MAX_ASPECT = 4.0
"""Maximum ratio of the sides of the image; windows are never so narrow or so wide."""
STILL_M, STILL_RAD = 1e-3, 1e-3
"""Motion of a camera below which it stands still, m and rad: rounding in the browser."""
LINE_PX = 2
"""Width of the divider, px."""


class Divider:
    """Shows two versions from the camera of a page instead of its Gaussians.

    Args:
        client: The page, of viser.
        viewed: The map.
        versions: Returns the numbers of the versions on the left and on the right.
        connect: Lets a control of the panel start a task of a name.
        on_toggle: Called when the image begins or ends to cover the Gaussians.
    """

    def __init__(
        self,
        client: Any,
        viewed: ViewedMap,
        versions: Callable[[], tuple[int, int]],
        connect: Callable[[Any, str, Callable[[], None]], None],
        on_toggle: Callable[[bool], None],
    ) -> None:
        self._client, self._map = client, viewed
        self._versions, self._on_toggle = versions, on_toggle
        self._rendered: tuple[RgbImage, RgbImage] | None = None
        self._still: tuple[int, Camera] | None = None
        self._box = client.gui.add_checkbox("Before | after", False)
        self._position = client.gui.add_slider(
            "Divider", min=0, max=1, step=0.01, initial_value=0.5, visible=False
        )
        connect(self._box.on_update, "divider", self._toggle)
        connect(self._position.on_update, "divide", self._divide)

    def show_still(self) -> None:
        """Show an image until the camera moves: a page draws many Gaussians late."""
        self._still = number, camera = self._versions()[1], self._camera()
        self._client.scene.set_background_image(self._render(number, camera), format="jpeg")

    def update(self) -> None:
        """Render anew, if it is on: the camera or a version has changed."""
        if self._box.value:
            left, right = (self._render(number, self._camera()) for number in self._versions())
            self._rendered, self._still = (left, right), None
            self._divide()
        elif self._still is not None:
            self._update_still(*self._still)

    def _update_still(self, number: int, camera: Camera) -> None:
        now = self._camera()
        moved_m, turned_rad = pose_distance(camera.world_from_camera, now.world_from_camera)
        if number != self._versions()[1] or moved_m > STILL_M or turned_rad > STILL_RAD:
            self._still = None
            self._client.scene.set_background_image(None)
        elif (camera.width, camera.height) != (now.width, now.height):
            self.show_still()  # The panel has opened.

    def _camera(self) -> Camera:
        return _camera_of(self._client.camera, self._map.origin)

    def _render(self, number: int, camera: Camera) -> RgbImage:
        return to_rgb8(render(self._map.gaussians(number), camera).rgb)

    def _toggle(self) -> None:
        self._position.visible = self._box.value
        self.update()
        if not self._box.value:
            self._client.scene.set_background_image(None)
        self._on_toggle(self._box.value)

    def _divide(self) -> None:
        if self._box.value and self._rendered is not None:
            left, right = self._rendered
            column = round(float(self._position.value) * left.shape[1])
            image = np.hstack([left[:, :column], right[:, column:]])
            image[:, max(0, column - LINE_PX) : column] = 255
            self._client.scene.set_background_image(image, format="jpeg")


def _camera_of(client_camera: Any, origin: Floats) -> Camera:
    """Return the camera of a page in the world.

    Raises:
        ValueError: The page gives no finite camera.
    """
    aspect = np.clip(float(client_camera.aspect), 1 / MAX_ASPECT, MAX_ASPECT)
    height = round(WIDTH_PX / aspect)
    slope = np.tan(float(client_camera.fov) / 2) * WIDTH_PX / height  # fov is the vertical one.
    pose = np.eye(4)
    pose[:3, :3] = rotation_of_quat(np.asarray(client_camera.wxyz, np.float64))
    pose[:3, 3] = origin + np.asarray(client_camera.position, np.float64)
    return camera_from_fov(WIDTH_PX, height, 2 * float(np.arctan(slope)), pose)
