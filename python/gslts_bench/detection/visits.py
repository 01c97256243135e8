"""Visits of homes in which nothing changed but the light, the exposure and what a robot errs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gslts.types import Floats
from gslts_sim.actions import GRID_M
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint, floor_of
from gslts_sim.sensor import SensorNoise

VISIT_POSITION_M, VISIT_ROTATION_DEG = 0.01, 0.5
"""Root mean square of the length of the error of the position, and of the angle of the error of the
rotation, of visits of unchanged homes."""
LIGHT_SHIFT_M = 0.5
"""By which the light of one lamp is moved sideways, before such a visit."""
VISIT_HORIZON_DEG = (0.0, 30.0)
"""As a robot looks that records a home."""
TRIES = 100


@dataclass(frozen=True, eq=False)
class Visit:
    """Where the robot looks from, and by how much the light of a lamp is moved in x and y, m."""

    look: Viewpoint
    light_shift_m: tuple[float, float]


def draw_visit(home: Home, rng: np.random.Generator) -> Visit:
    """A visit between the places and directions of a recording, which lie on grids."""
    angle = 2 * np.pi * rng.uniform()
    x, y = np.round([LIGHT_SHIFT_M * np.cos(angle), LIGHT_SHIFT_M * np.sin(angle)], 4).tolist()
    yaw_deg = round(float(rng.uniform(0, 360)), 1)
    horizon_deg = round(float(rng.uniform(*VISIT_HORIZON_DEG)), 1)
    return Visit(Viewpoint.at(_place(home, rng), yaw_deg, horizon_deg), (x, y))


def noise_of_visit(noise: SensorNoise) -> SensorNoise:
    """The same but for the pose, whose error is that of visits of unchanged homes."""
    return replace(
        noise,
        position_std_m=VISIT_POSITION_M / np.sqrt(3),
        rotation_std_rad=np.deg2rad(VISIT_ROTATION_DEG) / np.sqrt(3),
    )


def with_light_moved(home: Home, shift_m: tuple[float, float]) -> Home:
    """The home with the light of its first lamp elsewhere, and the lamp where it was.

    Raises:
        ValueError: It has no lamp.
    """
    lamp = next((thing for thing in home.objects if thing.lights), None)
    if lamp is None:
        raise ValueError(f"{home.name}: there is no lamp whose light could be moved")
    shift = lamp.world_from_object[:3, :3].T @ np.array([*shift_m, 0.0])
    first, *others = lamp.lights
    moved = replace(first, center=first.center + shift)
    return home.with_object(replace(lamp, lights=(moved, *others)))


def _place(home: Home, rng: np.random.Generator) -> Floats:
    floor = floor_of(home)
    places = floor.grid_positions(GRID_M)
    place = places[rng.integers(len(places))]
    for _ in range(TRIES):
        near: Floats = np.round(place + rng.uniform(-GRID_M / 2, GRID_M / 2, 2), 3)
        if floor.can_stand(near):
            return near
    kept: Floats = place
    return kept
