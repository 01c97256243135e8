"""Visits of homes in which only light, exposure and pose errors differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.types import Floats
from gslts_sim.actions import GRID_M
from gslts_sim.home import AreaLight, Home
from gslts_sim.robot_body import Viewpoint
from gslts_sim.sensor import SensorNoise
from gslts_sim.walkable import floor_of

VISIT_POSITION_M, VISIT_ROTATION_DEG = 0.01, 0.5
"""Root mean square error of position and rotation in visits of unchanged homes."""
LIGHT_SHIFT_M = 0.5
"""Sideways shift of the light of one lamp before such a visit."""
VISIT_HORIZON_DEG = (0.0, 30.0)
"""Range of the camera's pitch below the horizon, as in recordings."""
TRIES = 100
"""Maximum number of positions tried near a viewpoint; then the viewpoint itself is taken."""


@dataclass(frozen=True, eq=False)
class Visit:
    """Viewpoint of the robot, and shift of the light of a lamp in x and y, m."""

    viewpoint: Viewpoint
    light_shift_m: tuple[float, float]


def draw_visit(home: Home, rng: np.random.Generator) -> Visit:
    """Draw a visit between the positions and directions of a recording, which lie on grids.

    Args:
        home: State of the home.
        rng: Source of all randomness.
    """
    angle = 2 * np.pi * rng.uniform()
    x, y = np.round([LIGHT_SHIFT_M * np.cos(angle), LIGHT_SHIFT_M * np.sin(angle)], 4).tolist()
    yaw_deg = round(float(rng.uniform(0, 360)), 1)
    horizon_deg = round(float(rng.uniform(*VISIT_HORIZON_DEG)), 1)
    return Visit(Viewpoint.at(_draw_position(home, rng), yaw_deg, horizon_deg), (x, y))


def visit_noise(noise: SensorNoise) -> SensorNoise:
    """Return a sensor's noise with the pose error of visits of unchanged homes.

    Args:
        noise: The sensor's noise.
    """
    return replace(
        noise,
        position_std_m=VISIT_POSITION_M / np.sqrt(3),
        rotation_std_rad=np.deg2rad(VISIT_ROTATION_DEG) / np.sqrt(3),
    )


def move_light(home: Home, shift_m: tuple[float, float]) -> Home:
    """Move the light of the first lamp, but not the lamp; without lamps, that of the first room.

    Args:
        home: State of the home.
        shift_m: Shift in x and y of the world.

    Returns:
        The changed home.

    Raises:
        ValueError: The home has no light.
    """
    if not home.all_lights:
        raise ValueError(f"{home.name}: there is no light that could be moved")
    lamp = next((thing for thing in home.objects if thing.lights), None)
    if lamp is None:
        return replace(home, lights=_shift_first(home.lights, np.array([*shift_m, 0.0])))
    shift = lamp.world_from_object[:3, :3].T @ np.array([*shift_m, 0.0])
    return home.with_object(replace(lamp, lights=_shift_first(lamp.lights, shift)))


def _shift_first(lights: Sequence[AreaLight], shift: Floats) -> tuple[AreaLight, ...]:
    first, *others = lights
    return (replace(first, center=first.center + shift), *others)


def _draw_position(home: Home, rng: np.random.Generator) -> Floats:
    floor = floor_of(home)
    places = floor.grid_positions(GRID_M)
    place = places[rng.integers(len(places))]
    for _ in range(TRIES):
        near: Floats = np.round(place + rng.uniform(-GRID_M / 2, GRID_M / 2, 2), 3)
        if floor.can_stand(near):
            return near
    kept: Floats = place
    return kept
