"""Small homes of textured boxes that several tests share."""

from dataclasses import replace

import numpy as np

from gslts_sim.home import AreaLight, Home, HomeObject, Room
from gslts_sim.mesh import Surface


def box_surface(
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    texture: np.ndarray,
    *,
    inward: bool = False,
) -> Surface:
    """Return the faces of a box, seen from outside or, as the walls of a room, from inside."""
    corners = np.array([low, high], np.float64)
    vertices, faces, uvs = [], [], []
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, 1):
            quad = np.empty((4, 3))
            quad[:, axis] = corners[side, axis]
            quad[:, a] = corners[[0, 1, 1, 0], a]
            quad[:, b] = corners[[0, 0, 1, 1], b]
            outward = (side == 1) != inward
            order = [[0, 1, 2], [0, 2, 3]] if outward else [[0, 2, 1], [0, 3, 2]]
            in_quad = quad[:, [a, b]] - quad[0, [a, b]]
            faces.append(np.array(order) + 4 * len(vertices))
            uvs.append(in_quad[np.array(order)])
            vertices.append(quad)
    return Surface(
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        np.concatenate(uvs).astype(np.float32),
        texture,
    )


def box_object(
    object_id: str,
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    texture: np.ndarray,
    *,
    inward: bool = False,
) -> HomeObject:
    """Return a box in the world, or the walls around it, which are outside of it."""
    middle = np.array([0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]])
    local = tuple(np.array(low) - middle), tuple(np.array(high) - middle)
    pose = np.eye(4)
    pose[:3, 3] = middle
    return HomeObject(
        id=object_id,
        type=object_id.split("|")[0],
        surfaces=(box_surface(*local, texture, inward=inward),),
        boxes=_shell(*local) if inward else np.array([local]),
        world_from_object=pose,
    )


def _shell(low: tuple[float, ...], high: tuple[float, ...], thickness: float = 0.1) -> np.ndarray:
    """Return boxes [6,2,3] around a box."""
    boxes = np.tile(np.array([low, high]), (6, 1, 1))
    for axis in range(3):
        boxes[2 * axis, :, axis] = low[axis] - thickness, low[axis]
        boxes[2 * axis + 1, :, axis] = high[axis], high[axis] + thickness
    return boxes


def plain(value: int) -> np.ndarray:
    """Return a texture of one grey."""
    return np.full((4, 4, 3), value, np.uint8)


def simple_home(*, lights: bool = True, wall: np.ndarray | None = None) -> Home:
    """Return a room of 5 x 4 x 2.6 m with a block of 1.2 x 0.8 x 0.75 m in it."""
    light = AreaLight(
        center=np.array([2.5, 2.0, 2.59]),
        edge_u=np.array([0.0, 0.6, 0.0]),
        edge_v=np.array([0.6, 0.0, 0.0]),
        radiance=np.full(3, 20.0),
    )
    return Home(
        name="simple",
        rooms=(Room("kitchen", np.array([[0, 0, 0], [5, 4, 2.6]], float)),),
        objects=(
            box_object(
                "Wall|1", (0, 0, 0), (5, 4, 2.6), plain(200) if wall is None else wall, inward=True
            ),
            box_object("Block|1", (2.0, 1.5, 0), (3.2, 2.3, 0.75), plain(128)),
        ),
        lights=(light,) if lights else (),
        ambient=np.full(3, 0.3 if lights else 1.0),
    )


def furnished_home(lamp: str | None = None) -> Home:
    """Return `simple_home` with a floor and two mugs on the block; one may be a lamp."""
    home = simple_home()
    floor = box_object("Floor|1", (0, 0, -0.1), (5, 4, 0), plain(150))
    walls = replace(home["Wall|1"], boxes=np.delete(home["Wall|1"].boxes, 4, axis=0))
    block = replace(home["Block|1"], movable=True, receptacle=True, parent="Floor|1")
    mugs = [
        replace(
            box_object(f"Mug|{k}", (x, 1.7, 0.75), (x + 0.1, 1.8, 0.87), plain(60 + 90 * k)),
            movable=True,
            parent="Block|1",
        )
        for k, x in ((1, 2.5), (2, 2.2))
    ]
    light = replace(home.lights[0], center=np.array([0.0, 0.0, 0.2]))
    mugs = [replace(mug, lights=(light,)) if mug.id == lamp else mug for mug in mugs]
    return replace(home, objects=(walls, replace(floor, receptacle=True), block, *mugs))


def textured_home() -> Home:
    """Return `simple_home` with tiles on its walls."""
    rng = np.random.default_rng(0)
    tiles = rng.integers(40, 220, (2, 2, 3)).astype(np.uint8).repeat(16, 0).repeat(16, 1)
    return simple_home(wall=tiles)
