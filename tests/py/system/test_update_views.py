"""Views of a change, aligned with the map."""

from dataclasses import replace

import change_room
import numpy as np
import update_room

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.density.control import join
from gslts.update.views import View, align_view


def wall_beside(view: View) -> GaussianMap:
    """Return a wide grey Gaussian at the left edge of a view, 4 sigma from the camera."""
    gaussian_map, _ = change_room.mapped()
    wall = gaussian_map.select(np.arange(1))
    pose = view.camera.world_from_camera
    position = pose[:3, :3] @ np.array([-0.4, 0, 0.4]) + pose[:3, 3] - gaussian_map.origin
    return replace(
        wall,
        means=position[None].astype(np.float32),
        log_scales=np.log(np.full((1, 3), 0.1, np.float32)),
        logit_opacities=np.full_like(wall.logit_opacities, 3),
        sh=np.zeros_like(wall.sh),
    )


def test_a_wall_beside_the_camera_does_not_occlude_the_scene() -> None:
    view = update_room.collected("removal").views[0]
    gaussian_map, _ = change_room.mapped()
    alone = align_view(view, gaussian_map, threads=1)
    beside = align_view(view, join(gaussian_map, wall_beside(view)), threads=1)
    known = (alone.rendered_depth > 0) & (beside.rendered_depth > 0)
    off = np.abs(alone.rendered_depth - beside.rendered_depth)[known] > 0.1
    assert off.mean() < 0.01
