"""Views around a change: the rule-based policy of GS-LTS, sec. III-D.

The robot faces the region, goes along the tangent of a circle around it to the left and to the
right, and aims and ranges anew after each step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.change.changes import Change
from gslts.change.detector import ChangeDetector, Detection
from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.types import Bools, Floats
from gslts.update.config import CollectConfig
from gslts.update.evidence import shown_of, shows
from gslts.update.extent import extended
from gslts.update.region import Region, regions_of
from gslts.update.views import View, aligned_view, masks_of, view_of

LEAST_DISTANCE_M, MOST_DISTANCE_M = 0.7, 2.5
"""On the floor. Nearer, a camera measures no depth; farther, it sees too little."""


@dataclass(frozen=True, eq=False)
class Collection:
    """Views around changes.

    Attributes:
        views: In the order in which they were taken.
        changes: What the views show of those that were detected.
        regions_of_each: Of each of these changes, as the views show them.
        left: Changes that the views do not show, and why.
        skipped: Why other frames do not count.
    """

    views: tuple[View, ...]
    changes: tuple[Change, ...]
    regions_of_each: tuple[tuple[Region, ...], ...]
    left: tuple[tuple[Change, str], ...]
    skipped: tuple[str, ...]

    @property
    def regions(self) -> tuple[Region, ...]:
        """Of all changes that the views show."""
        return tuple(region for own in self.regions_of_each for region in own)


def collect(
    robot: Robot,
    detector: ChangeDetector,
    changes: Sequence[Change],
    config: CollectConfig,
    *,
    threads: int = 0,
    tell: Callable[[], None] = lambda: None,
) -> Collection:
    """Lets a robot look at each region of some changes from all sides that it can reach.

    Args:
        robot: Somewhere near.
        detector: Of the map as it is.
        changes: As detected.
        config: Settings.
        threads: 0 means one a hardware thread.
        tell: Is told of each step.

    Returns:
        What it saw; no view where no place is reachable that shows a region.
    """
    first = [region for change in changes for region in regions_of(change)]
    tour = _Tour(robot, detector, first, config, tell)
    for number in range(len(first)):
        tour.go_around(number)
    seen = []
    for frame, detection in tour.seen:
        view = view_of(detection, frame, tour.regions)
        if view is not None:
            # What is left as it was changes all the same: no pose must be fitted to it.
            view = aligned_view(view, detector.gaussian_map, threads)
        if view is None:
            tour.skipped.append("a frame fits the map at another place")
        else:
            seen.append((view, detection))
    waiting = list(tour.regions)
    shown: list[tuple[Change, tuple[Region, ...]]] = []
    left: list[tuple[Change, str]] = []
    for change in changes:
        own = [waiting.pop(0) for _ in regions_of(change)]
        found = shown_of(change, own, seen, tour.skipped)
        if isinstance(found, str):
            left.append((change, found))
        else:
            sides = [region.side for region in regions_of(found)]
            shown.append((found, tuple(region for region in own if region.side in sides)))
    regions = [region for _, own in shown for region in own]
    views = []
    for view, detection in seen:
        before, after = masks_of(detection, view.changed.shape, regions)
        views.append(replace(view, before=before, after=after))
    grown, larger = extended(regions, views)
    waiting = list(grown)
    return Collection(
        views=larger,
        changes=tuple(change for change, _ in shown),
        regions_of_each=tuple(tuple(waiting.pop(0) for _ in own) for _, own in shown),
        left=tuple(left),
        skipped=tuple(tour.skipped),
    )


class _Tour:
    """A robot on its way around some regions."""

    def __init__(
        self,
        robot: Robot,
        detector: ChangeDetector,
        regions: list[Region],
        config: CollectConfig,
        tell: Callable[[], None],
    ) -> None:
        self.regions = regions
        self.seen: list[tuple[RgbdFrame, Detection]] = []
        self.skipped: list[str] = []
        self._robot, self._detector, self._config, self._tell = robot, detector, config, tell
        self._frames = [robot.observe()]

    def go_around(self, number: int) -> None:
        """K/2 steps to the left, K to the right; where one side ends, the other goes on.

        The steps are so long that the views show all sides that can be reached: what no view shows
        of an object would be missing from the map, and be reported as a change once it is seen.
        """
        places = self._robot.reachable_positions()
        config = self._config
        region = self.regions[number]
        first = _bearing(self._frames[-1].camera.world_from_camera[:2, 3] - region.middle[:2])
        step_rad = config.step_m / config.distance_m
        step_rad = max(step_rad, _reachable_rad(places, region, step_rad) / (config.steps + 1))
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
        if not taken:
            self.skipped.append("no place around it is reachable")

    def _place(self, number: int, places: Floats, taken: list[int], bearing: float) -> int | None:
        """A place in a direction from the region that was not visited yet, at a good distance."""
        region, config = self.regions[number], self._config
        metres, bearings = _seen_from_region(places, region)
        off_rad = np.abs((bearings - bearing + np.pi) % (2 * np.pi) - np.pi)
        fits = _fits(metres) & (off_rad <= config.step_m / config.distance_m)
        fits[taken] = False
        if not fits.any():
            return None
        wanted_m = max(config.distance_m, float(np.linalg.norm(region.high - region.low)))
        off_m = np.hypot(metres - wanted_m, metres * off_rad)
        return int(np.argmin(np.where(fits, off_m, np.inf)))

    def _look_from(self, place: Floats, number: int) -> bool:
        """Whether a place is reached from which a frame shows the region."""
        region = self.regions[number]
        way = region.middle[:2] - place
        eye_m = float(self._frames[-1].camera.world_from_camera[2, 3])
        pitch_rad = float(np.arctan2(eye_m - region.middle[2], np.linalg.norm(way)))
        if not self._robot.move_towards(place, _bearing(way), pitch_rad):
            self.skipped.append(f"the robot did not reach ({place[0]:.2f}, {place[1]:.2f})")
            return False
        frame = self._robot.observe()
        if any(frame is other for other in self._frames):  # Of a recording.
            return False
        self._frames.append(frame)
        name = f"frame {len(self._frames)}"
        if not shows(frame, region):
            self.skipped.append(f"{name}: it does not show the {region.side} region")
            return False
        detection = self._detector.detect(frame)
        if detection.unreliable is not None:
            self.skipped.append(f"{name}: {detection.unreliable}")
            return False
        self.seen.append((frame, detection))
        for k, one in enumerate(self.regions):
            self.regions[k] = one.with_surfaces(filter(one.is_of, detection.surfaces))
        return True


def _bearing(way: Floats) -> float:
    return float(np.arctan2(way[1], way[0]))


def _seen_from_region(places: Floats, region: Region) -> tuple[Floats, Floats]:
    """[P] distances, m, and bearings, rad, of places [P,2] from the middle of a region."""
    ways = places - region.middle[:2]
    return np.linalg.norm(ways, axis=1), np.arctan2(ways[:, 1], ways[:, 0])


def _fits(metres: Floats) -> Bools:
    """[P] whether a camera at such distances sees a region well."""
    return np.asarray((metres >= LEAST_DISTANCE_M) & (metres <= MOST_DISTANCE_M), np.bool_)


def _reachable_rad(places: Floats, region: Region, sector_rad: float) -> float:
    """Sum of the sectors around a region in which there is a position [P,2], rad."""
    metres, bearings = _seen_from_region(places, region)
    sectors = int(np.ceil(2 * np.pi / sector_rad))
    taken = np.unique(((bearings[_fits(metres)] + np.pi) / (2 * np.pi) * sectors).astype(int))
    return 2 * np.pi * len(taken) / sectors
