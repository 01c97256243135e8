"""Pictures of a home for people: views from the corners and a labelled plan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gslts.camera import Camera, camera_from_fov, look_at
from gslts.sim.home import Home, Room
from gslts.sim.ray_scene import RayScene
from gslts.sim.raycast import RayCaster
from gslts.sim.texture_atlas import srgb_from_linear

EYE_HEIGHT_M = 1.6
CORNER_SHARES = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35)
"""Shares of the room between the corner views and the walls; the first free one is taken."""
FREE_M = 0.8
"""Nine tenths of a free view are farther away."""
HORIZONTAL_FOV_RAD = 1.35
PLAN_DISTANCE_M = 60.0
"""From so high above, the plan shows hardly any walls from the side."""
PLAN_PX_PER_M = 160


def corner_cameras(home: Home, width: int = 480, height: int = 360) -> list[Camera]:
    """Cameras in the four corners of the first room that look at its middle past the furniture."""
    room, scene = home.rooms[0], RayScene(home)
    cameras = []
    for corner in ((0, 0), (1, 0), (1, 1), (0, 1)):
        tried = [_corner_camera(room, corner, share, width, height) for share in CORNER_SHARES]
        near_m = [_near_m(scene, camera) for camera in tried]
        free = [row for row, metres in enumerate(near_m) if metres > FREE_M]
        cameras.append(tried[free[0] if free else int(np.argmax(near_m))])
    return cameras


def _corner_camera(
    room: Room, corner: tuple[int, int], share: float, width: int, height: int
) -> Camera:
    low, high = room.box
    place = low + (share + (1 - 2 * share) * np.array([*corner, 0])) * (high - low)
    eye = (place[0], place[1], low[2] + EYE_HEIGHT_M)
    pose = look_at(eye, (*((low + high) / 2)[:2], low[2] + 0.9))
    return camera_from_fov(width, height, HORIZONTAL_FOV_RAD, pose)


def _near_m(scene: RayScene, camera: Camera) -> float:
    """Depth that nine tenths of a view exceed, m."""
    small = camera_from_fov(32, 24, HORIZONTAL_FOV_RAD, camera.world_from_camera)
    return float(np.percentile(scene.instances(small)[1], 10))


def write_contact_sheet(home: Home, path: Path) -> None:
    """Writes the four corner views of the first room and its plan as one PNG.

    Raises:
        OSError: The file cannot be written.
    """
    room = home.rooms[0]
    caster = RayCaster(home)
    figure = Figure(figsize=(15, 6.4), layout="constrained")
    FigureCanvasAgg(figure)
    movable = sum(thing.movable for thing in home.objects)
    figure.suptitle(f"{home.name}: {len(home.objects)} objects, {movable} of them movable")
    grid = figure.add_gridspec(2, 3, width_ratios=(1, 1, 1.25))
    for index, camera in enumerate(corner_cameras(home)):
        axes = figure.add_subplot(grid[index // 2, index % 2])
        axes.imshow(_rgb(caster, camera))
        axes.set_axis_off()
    axes = figure.add_subplot(grid[:, 2])
    (x0, y0, _), (x1, y1, _) = room.box
    axes.imshow(plan_of(home, room), extent=(x0, x1, y0, y1))
    for thing in home.objects:
        low, high = thing.box_in_world
        middle = (low + high) / 2
        inside = np.all(room.box[0] <= middle) and np.all(middle <= room.box[1])
        if inside and np.all(high - low < 0.8 * (room.box[1] - room.box[0])[[0, 1, 1]]):
            axes.text(
                middle[0],
                middle[1],
                thing.id,
                fontsize=5,
                ha="center",
                va="center",
                color="white" if thing.movable else "yellow",
                bbox={"color": "black", "alpha": 0.45, "pad": 0.6},
            )
    axes.set(xlabel="x, m", ylabel="y, m", title="plan (white: movable)")
    figure.savefig(path, dpi=110)


def _rgb(caster: RayCaster, camera: Camera) -> NDArray[np.uint8]:
    radiance = caster.look(camera).radiance
    rgb: NDArray[np.uint8] = np.rint(255 * srgb_from_linear(radiance.clip(0, 1))).astype(np.uint8)
    return rgb


def plan_of(home: Home, room: Room) -> NDArray[np.uint8]:
    """The room from above, north (y) up, without what hangs at the ceiling."""
    (x0, y0, z0), (x1, y1, z1) = room.box
    hidden: set[str] = {o.id for o in home.objects if o.box_in_world[0, 2] > z1 - 0.3}
    while True:
        more = {o.id for o in home.objects if o.parent in hidden} - hidden
        if not more:
            break
        hidden |= more
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = ((x0 + x1) / 2, (y0 + y1) / 2, z0 + PLAN_DISTANCE_M)
    width, height = (round(PLAN_PX_PER_M * size) for size in (x1 - x0, y1 - y0))
    focal = PLAN_PX_PER_M * PLAN_DISTANCE_M
    camera = Camera(
        fx=focal,
        fy=focal,
        cx=width / 2,
        cy=height / 2,
        width=width,
        height=height,
        world_from_camera=pose,
    )
    return _rgb(RayCaster(home.without(hidden)), camera)
