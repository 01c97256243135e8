"""Views around a change: the rule-based policy of GS-LTS, sec. III-D.

The robot faces the region, goes along the tangent of a circle around it to the left and to the
right, and aims and ranges anew after each step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.change.detect import ChangeDetector, Detection
from gslts.frame import RgbdFrame
from gslts.robot import Robot
from gslts.update.config import CollectConfig
from gslts.update.extent import extended
from gslts.update.region import Site
from gslts.update.views import View, aligned_view, view_of

Floats = NDArray[np.float64]

LEAST_DISTANCE_M, MOST_DISTANCE_M = 0.7, 2.5
"""On the floor. Nearer, a camera measures no depth; farther, it sees too little."""
INSIDE = 0.06
"""Share of the image's width by which the middle of a site must lie within it."""
HIDDEN_M = 0.15
"""What is measured so much before a site hides it."""


@dataclass(frozen=True, eq=False)
class Collection:
    """Views around the sites of a change.

    Attributes:
        views: Of the sites, in the order in which they were taken.
        sites: The sites as these views show them.
        skipped: Why other frames do not count.
    """

    views: tuple[View, ...]
    sites: tuple[Site, ...]
    skipped: tuple[str, ...]


def collect(
    robot: Robot,
    detector: ChangeDetector,
    sites: Sequence[Site],
    config: CollectConfig,
    *,
    threads: int = 0,
    tell: Callable[[], None] = lambda: None,
) -> Collection:
    """Lets a robot look at each site from all sides that it can reach.

    Args:
        robot: Somewhere near.
        detector: Of the map as it is.
        sites: Where something changed.
        config: Settings.
        threads: 0 means one a hardware thread.
        tell: Is told of each step.

    Returns:
        What it saw; no view where no place is reachable that shows a site.
    """
    tour = _Tour(robot, detector, list(sites), config, tell)
    for number in range(len(sites)):
        tour.go_around(number)
    views = (view_of(detection, frame, tour.sites) for frame, detection in tour.seen)
    aligned = [
        aligned_view(view, detector.gaussian_map, threads) for view in views if view is not None
    ]
    grown, larger = extended(tour.sites, aligned)
    return Collection(larger, grown, tuple(tour.skipped))


def shows(frame: RgbdFrame, site: Site) -> bool:
    """Whether the middle of a site is in a frame and nothing is before it."""
    camera = frame.camera
    middle = site.middle_in(camera)
    if middle is None:
        return False
    u, v, z = middle
    margin = INSIDE * camera.width
    if not (margin <= u < camera.width - margin and margin <= v < camera.height - margin):
        return False
    depth = frame.registered().depth[int(v), int(u)]
    reach_m = HIDDEN_M + 0.5 * float(np.linalg.norm(site.high - site.low))
    return not bool(0 < depth < z - reach_m)


class _Tour:
    """A robot on its way around some sites."""

    def __init__(
        self,
        robot: Robot,
        detector: ChangeDetector,
        sites: list[Site],
        config: CollectConfig,
        tell: Callable[[], None],
    ) -> None:
        self.sites = sites
        self.seen: list[tuple[RgbdFrame, Detection]] = []
        self.skipped: list[str] = []
        self._robot, self._detector, self._config, self._tell = robot, detector, config, tell
        self._frames = [robot.observe()]

    def go_around(self, number: int) -> None:
        """K/2 steps to the left, K to the right; where one side ends, the other goes on."""
        places = self._robot.reachable_positions()
        if len(places) == 0:
            return
        config = self._config
        site = self.sites[number]
        first = _bearing(self._frames[-1].camera.world_from_camera[:2, 3] - site.middle[:2])
        step_rad = config.step_m / config.distance_m
        most_steps = int(np.pi / step_rad)
        left = range(config.steps // 2 + 1)
        right = range(-1, -most_steps - 1, -1)
        rest = range(config.steps // 2 + 1, most_steps + 1)
        taken: list[int] = []
        views = 0
        for step in (*left, *right, *rest):
            if views > config.steps:
                return
            place = self._place(number, places, taken, first + step * step_rad)
            if place is not None:
                taken.append(place)
                views += self._look_from(places[place], number)
                self._tell()

    def _place(self, number: int, places: Floats, taken: list[int], bearing: float) -> int | None:
        """A place in a direction from the site that was not visited yet, at a fitting distance."""
        site, config = self.sites[number], self._config
        ways = places - site.middle[:2]
        metres = np.linalg.norm(ways, axis=1)
        turns_rad = np.arctan2(ways[:, 1], ways[:, 0]) - bearing
        off_rad = np.abs((turns_rad + np.pi) % (2 * np.pi) - np.pi)
        fits = (metres >= LEAST_DISTANCE_M) & (metres <= MOST_DISTANCE_M)
        fits &= off_rad <= config.step_m / config.distance_m
        fits[taken] = False
        if not fits.any():
            return None
        wanted_m = max(config.distance_m, float(np.linalg.norm(site.high - site.low)))
        off_m = np.hypot(metres - wanted_m, metres * off_rad)
        return int(np.argmin(np.where(fits, off_m, np.inf)))

    def _look_from(self, place: Floats, number: int) -> bool:
        """Whether a place is reached from which a frame shows the site."""
        site = self.sites[number]
        way = site.middle[:2] - place
        eye_m = float(self._frames[-1].camera.world_from_camera[2, 3])
        pitch_rad = float(np.arctan2(eye_m - site.middle[2], np.linalg.norm(way)))
        if not self._robot.move_towards(place, _bearing(way), pitch_rad):
            self.skipped.append(f"the robot did not reach ({place[0]:.2f}, {place[1]:.2f})")
            return False
        frame = self._robot.observe()
        if any(frame is other for other in self._frames):  # Of a recording.
            return False
        self._frames.append(frame)
        name = f"frame {len(self._frames)}"
        if not shows(frame, site):
            self.skipped.append(f"{name}: it does not show the {site.side} site")
            return False
        detection = self._detector.detect(frame)
        if detection.unreliable is not None:
            self.skipped.append(f"{name}: {detection.unreliable}")
            return False
        self.seen.append((frame, detection))
        for k, one in enumerate(self.sites):
            self.sites[k] = one.with_surfaces(filter(one.is_of, detection.surfaces))
        return True


def _bearing(way: Floats) -> float:
    return float(np.arctan2(way[1], way[0]))
