"""Exploration of unmapped space that a robot can reach."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gslts.change.visibility import Visibility
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.robots.driving import go_to, short_path
from gslts.types import Floats

SPACING_M = 0.8
"""Distance between the positions where the robot looks around, m."""
MIN_SEEN, MAX_DEPTH_M = 2, 3.0
"""Minimum number of training cameras that saw the space at a known position from at most so far, m:
what was seen from afar only, the map shows blurred."""
MIN_POSITIONS = 2
"""Minimum number of unmapped positions that are worth an extension."""
KNOWN_VIEWS = 4
"""Number of training cameras whose views the robot takes before and after it looks around: by these
frames, all others are placed in the map."""
MAX_POSITIONS = 20
"""Maximum number of positions of one exploration: a room of 13 m2; a later one goes on."""
RINGS = ((8, np.deg2rad(20)), (4, np.deg2rad(-10)))
"""Views at each position: number of directions all around, and the angle of the camera below the
horizon, rad. At a field of view of 90 degrees, neighbours of the first ring, which shows floor and
furniture, share half of it; the second one shows the ceiling."""


def plan_exploration(robot: Robot, visibility: Visibility) -> Floats:
    """Choose positions from which a robot sees space that no camera of the map saw.

    Args:
        robot: In the home.
        visibility: Of the training cameras of the map.

    Returns:
        [P,2] positions in the order of a short path, x and y, m. Empty if there is no unmapped
        space.
    """
    positions = _thin(robot.reachable_positions())
    here = robot.pose()
    points = np.column_stack([positions, np.full(len(positions), here[2, 3])])
    counts = visibility.counts(points, np.full(len(points), MAX_DEPTH_M))
    known = counts.through + counts.on >= MIN_SEEN
    unmapped = positions[~known]
    if len(unmapped) < MIN_POSITIONS:
        return np.zeros((0, 2))
    poses = np.tile(here, (len(unmapped), 1, 1))
    poses[:, :2, 3] = unmapped
    return unmapped[short_path(poses, here)[:MAX_POSITIONS]]


def look_around(robot: Robot, positions: Floats, cameras: Sequence[Camera]) -> Iterator[RgbdFrame]:
    """Move a robot to positions, and yield the frames that it observes in all directions there.

    Args:
        robot: In the home. Positions that it does not reach are skipped.
        positions: [P,2] x and y, m.
        cameras: Of the map; views of those nearest to the ends of the path are taken as well.
    """
    yield from _known_views(robot, positions[0], cameras)
    for position in positions:
        for count, pitch_rad in RINGS:
            for number in range(count):
                if robot.move_towards(position, 2 * np.pi * number / count, float(pitch_rad)):
                    yield robot.observe()
    yield from _known_views(robot, positions[-1], cameras)


def _known_views(robot: Robot, position: Floats, cameras: Sequence[Camera]) -> Iterator[RgbdFrame]:
    centres = np.array([camera.world_from_camera[:2, 3] for camera in cameras]).reshape(-1, 2)
    nearest = np.argsort(np.linalg.norm(centres - position, axis=1), kind="stable")[:KNOWN_VIEWS]
    for row in nearest:
        if go_to(robot, cameras[row]):
            yield robot.observe()


def _thin(positions: Floats) -> Floats:
    """Return one of the positions [P,2] in each square of `SPACING_M`, nearest to its middle."""
    squares = np.floor(positions / SPACING_M)
    offsets_m = np.linalg.norm(positions - (squares + 0.5) * SPACING_M, axis=1)
    order = np.lexsort((offsets_m, squares[:, 1], squares[:, 0]))
    _, rows = np.unique(squares[order], axis=0, return_index=True)
    return positions[order[rows]]
