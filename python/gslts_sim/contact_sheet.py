"""Contact sheet of a home: views from the corners of its rooms and a labelled plan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from gslts.core.camera import Camera, camera_from_fov, look_at
from gslts.types import Bytes
from gslts_sim.home import Home, Room
from gslts_sim.ray_scene import RayScene
from gslts_sim.raycast import RayCaster
from gslts_sim.texture_atlas import srgb_from_linear

EYE_HEIGHT_M = 1.6
"""Height of the corner cameras, m; a standing person."""
CORNER_FRACTIONS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35)
"""Distances of a corner camera from the walls, as fractions of the room; the first free one is
taken."""
FREE_M = 0.8
"""Depth that 90 % of the pixels of an unobstructed view exceed, m."""
HORIZONTAL_FOV_RAD = 1.35
"""Field of view of the corner cameras, rad; shows most of a room without strong distortion."""
PLAN_DISTANCE_M, PLAN_DISTANCES = 60.0, 10.0
"""Minimum height of the camera of a plan, m, and as a multiple of the longer side: from there,
walls are hardly seen from the side."""
PLAN_PX_PER_M = 160
"""Resolution of a plan within the limits PLAN_PX, px/m."""
PLAN_PX = (200, 2000)
"""Minimum and maximum number of pixels of the longer side of a plan."""
CEILING_M = 0.3
"""Objects within this distance of a ceiling, or a quarter of a low room, are left out of the plan,
m: they hide the rest."""
MAX_ROOMS = 4
"""Maximum number of rooms with views; of more rooms, the largest are shown."""
CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))
"""Corners of the views where there is one room: the upper end of x and of y, or not."""


def corner_cameras(
    home: Home,
    width: int = 480,
    height: int = 360,
    room: Room | None = None,
    corners: tuple[tuple[int, int], ...] = CORNERS,
) -> list[Camera]:
    """Return cameras in the corners of a room that see its middle past the furniture.

    Args:
        home: With all its objects.
        width: Of the images, px.
        height: Of the images, px.
        room: One of its rooms; None for the first.
        corners: For each camera, whether it is at the upper end of x and of y.
    """
    room, scene = home.rooms[0] if room is None else room, RayScene(home)
    cameras = []
    for corner in corners:
        tried = [_corner_camera(room, corner, f, width, height) for f in CORNER_FRACTIONS]
        near_m = [_near_m(scene, camera) for camera in tried]
        free = [row for row, metres in enumerate(near_m) if metres > FREE_M]
        cameras.append(tried[free[0] if free else int(np.argmax(near_m))])
    return cameras


def _corner_camera(
    room: Room, corner: tuple[int, int], fraction: float, width: int, height: int
) -> Camera:
    low, high = room.box
    position = low + (fraction + (1 - 2 * fraction) * np.array([*corner, 0])) * (high - low)
    eye = (position[0], position[1], low[2] + EYE_HEIGHT_M)
    pose = look_at(eye, (*((low + high) / 2)[:2], low[2] + 0.9))
    return camera_from_fov(width, height, HORIZONTAL_FOV_RAD, pose)


def _near_m(scene: RayScene, camera: Camera) -> float:
    """Return the depth that 90 % of the pixels of a view exceed, m."""
    small = camera_from_fov(32, 24, HORIZONTAL_FOV_RAD, camera.world_from_camera)
    return float(np.percentile(scene.instances(small)[1], 10))


def write_contact_sheet(home: Home, path: Path) -> None:
    """Write views from the corners of the rooms and a labelled plan as one PNG.

    A single room is shown from its four corners, each of several rooms from two.

    Args:
        home: With all its objects.
        path: Of the PNG file.

    Raises:
        OSError: The file cannot be written.
    """
    several = len(home.rooms) > 1
    x_m, y_m, _ = home.space.box[1] - home.space.box[0]
    wide = y_m / x_m if several and 1.3 * y_m < x_m else None
    figure, views, plan = _layout(min(len(home.rooms), MAX_ROOMS), wide)
    movable = sum(obj.movable for obj in home.objects)
    title = f"{home.name}: {len(home.objects)} objects, {movable} of them movable"
    figure.suptitle(title, parse_math=False)
    caster = RayCaster(home)
    shown = _largest_rooms(home)
    for row, number in enumerate(shown):
        room, corners = home.rooms[number], ((0, 0), (1, 1)) if several else CORNERS
        cameras = corner_cameras(home, room=room, corners=corners)
        for axes, camera in zip(views[row * len(corners) :], cameras, strict=False):
            axes.imshow(_rgb(caster, camera))
            axes.set_axis_off()
            if several:
                axes.set_title(_room_name(home, number), parse_math=False, fontsize=10)
    _draw_plan(plan, home)
    figure.savefig(path, dpi=110)


def _largest_rooms(home: Home) -> list[int]:
    """Return the numbers of the largest rooms, in the home's order."""
    areas = [float(np.prod(np.diff(room.box[:, :2], axis=0))) for room in home.rooms]
    return sorted(np.argsort(areas, kind="stable")[::-1][:MAX_ROOMS].tolist())


def _room_name(home: Home, number: int) -> str:
    return f"room {number + 1}: {home.rooms[number].type}"


def _layout(rooms: int, wide: float | None) -> tuple[Figure, list[Axes], Axes]:
    """Return a figure with axes for the views, row by row, and for the plan.

    Args:
        rooms: Number of rooms whose views are shown.
        wide: Ratio of height to width of a plan above the views, which are four in a row; None for
            a plan beside them.
    """
    if wide is not None:
        rows, plan_in, view_in = (rooms + 1) // 2, 14 * wide + 1, 3.1
        figure = Figure(figsize=(15, 0.4 + plan_in + rows * view_in), layout="constrained")
        grid = figure.add_gridspec(1 + rows, 4, height_ratios=(plan_in, *rows * (view_in,)))
        views, plan = [grid[1 + k // 4, k % 4] for k in range(2 * rooms)], grid[0, :]
    else:
        rows = max(2, rooms)
        figure = Figure(figsize=(15, 3.2 * rows), layout="constrained")
        grid = figure.add_gridspec(rows, 3, width_ratios=(1, 1, 1.25))
        views, plan = [grid[k // 2, k % 2] for k in range(2 * rows)], grid[:, 2]
    FigureCanvasAgg(figure)
    return figure, [figure.add_subplot(view) for view in views], figure.add_subplot(plan)


def _draw_plan(axes: Axes, home: Home) -> None:
    (x0, y0, _), (x1, y1, _) = home.space.box
    min_side = max(x1 - x0, y1 - y0) / PLAN_PX[1]  # A home may be flat.
    extent = (x0, max(x1, x0 + min_side), y0, max(y1, y0 + min_side))
    axes.imshow(plan_of(home, home.space), extent=extent)
    for number, room in enumerate(home.rooms if len(home.rooms) > 1 else ()):
        (left, bottom, _), (right, top, _) = room.box
        outline = Rectangle((left, bottom), right - left, top - bottom, fill=False, color="#00d0ff")
        axes.add_patch(outline)
        axes.text(
            left, top, _room_name(home, number), color="#00d0ff", va="top", parse_math=False,
            bbox={"color": "black", "alpha": 0.85, "pad": 1.5}, fontsize=9, zorder=10,
        )  # fmt: skip
    for obj in home.objects:
        low, high = obj.box_in_world
        middle = (low + high) / 2
        around = [r.box for r in home.rooms if (r.box[0] <= middle).all()]
        around = [box for box in around if (middle <= box[1]).all()]
        if around and np.all(high - low < 0.8 * (around[0][1] - around[0][0])[[0, 1, 1]]):
            axes.text(
                middle[0],
                middle[1],
                obj.id,
                fontsize=5,
                ha="center",
                va="center",
                color="white" if obj.movable else "yellow",
                bbox={"color": "black", "alpha": 0.45, "pad": 0.6},
                parse_math=False,
            )
    axes.set(xlabel="x, m", ylabel="y, m", title="plan (white: movable)")


def _rgb(caster: RayCaster, camera: Camera) -> Bytes:
    radiance = caster.render(camera).radiance
    rgb: Bytes = np.rint(255 * srgb_from_linear(radiance.clip(0, 1))).astype(np.uint8)
    return rgb


def plan_of(home: Home, room: Room) -> Bytes:
    """Render a room from above, y up, without the objects at the ceilings.

    Args:
        home: With all its objects.
        room: One of its rooms, or `home.space` for all.

    Returns:
        [H,W,3] uint8, sRGB.
    """
    (x0, y0, z0), (x1, y1, _) = room.box
    longer = max(x1 - x0, y1 - y0)
    px_per_m = float(np.clip(PLAN_PX_PER_M * longer, *PLAN_PX) / longer)
    distance = max(PLAN_DISTANCE_M, PLAN_DISTANCES * longer)
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = ((x0 + x1) / 2, (y0 + y1) / 2, z0 + distance)
    width, height = (max(1, round(px_per_m * size)) for size in (x1 - x0, y1 - y0))
    focal = px_per_m * distance
    camera = Camera(
        fx=focal,
        fy=focal,
        cx=width / 2,
        cy=height / 2,
        width=width,
        height=height,
        world_from_camera=pose,
    )
    return _rgb(RayCaster(home.without(_at_ceilings(home, room))), camera)


def _at_ceilings(home: Home, around: Room) -> set[str]:
    """Return the ids of objects at the ceiling of their room and all that stands on them.

    Returns none if that would be all objects.
    """
    below_m = min(CEILING_M, float(around.box[1, 2] - around.box[0, 2]) / 4)
    hidden: set[str] = set()
    for obj in home.objects:
        low, high = obj.box_in_world
        middle = ((low + high) / 2)[:2]
        tops = [
            float(room.box[1, 2])
            for room in home.rooms
            if (room.box[0, :2] <= middle).all() and (middle <= room.box[1, :2]).all()
        ]
        if low[2] > min(tops, default=float(around.box[1, 2])) - below_m:
            hidden.add(obj.id)
    while True:
        more = {o.id for o in home.objects if o.parent in hidden} - hidden
        if not more:
            return hidden if len(hidden) < len(home.objects) else set()
        hidden |= more
