"""Rule-based policy that moves a robot around a changed region.

Source: GS-LTS, sec. III-D, Active Data Collection: the robot faces the region and moves along the
tangent of a circle around it, K/2 steps to the left, then K steps to the right. After each step it
turns to the region and corrects its distance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gslts.change.detection import Detection
from gslts.change.detector import ChangeDetector
from gslts.core.farthest_points import farthest_points
from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.types import Bools, Floats
from gslts.update.config import CollectConfig
from gslts.update.evidence import FAR_M, GIVE_UP_LOG_ODDS, evidence_of, is_visible
from gslts.update.region import Region

MIN_DISTANCE_M = 0.7
"""Minimum distance of the camera from the centre of a region on the floor, m; nearer, it measures
no depth."""


class Tour:
    """Frames around some regions, with their detections.

    Args:
        robot: Near the regions.
        detector: Of the map before the update.
        regions: To visit; they grow by what the frames show in them or near them.
        config: Settings.
        progress: Called after each step.
        recorded: Frames taken before; those that show a region and have no fault count.

    Attributes:
        regions: As the frames show them.
        frames: Registered frames that show a region, with their detections.
        skipped: Reasons for skipping other frames.
    """

    def __init__(
        self,
        robot: Robot,
        detector: ChangeDetector,
        regions: list[Region],
        config: CollectConfig,
        progress: Callable[[], None],
        recorded: Sequence[RgbdFrame] = (),
    ) -> None:
        self.regions = regions
        self.frames: list[tuple[RgbdFrame, Detection]] = []
        self.skipped: list[str] = []
        self._robot, self._detector, self._config = robot, detector, config
        self._progress = progress
        # By the frame that the robot may observe too: it counts once.
        self._recorded = {frame: frame.registered() for frame in recorded if frame.fault is None}
        self._observed: list[RgbdFrame] = []
        self._reported = tuple(regions)
        self._log_odds = [0.0] * len(regions)
        if not recorded:
            self._observed.append(robot.observe())

    def visit(self, index: int) -> None:
        """Observe a region from K + 1 positions on a circle around it.

        Where one side is blocked, the other one gets more steps. The steps are so long that the
        views cover all sides that can be reached: a side that no view shows would be missing in the
        map, and be reported as a change later. Frames that were taken near such a position for
        another region count. Where the first views show no change, no more are taken.

        Args:
            index: Of the region.
        """
        region, config = self.regions[index], self._config
        earlier = [frame for frame, _ in self.frames]
        views = self._use_recorded(index)
        positions = self._robot.reachable_positions()
        start = _bearing(self._robot.pose()[:2, 3] - region.center[:2])
        step_rad = config.step_m / config.distance_m
        reachable_rad = _reachable_angle(positions, region, step_rad)
        step_rad = max(step_rad, reachable_rad / (config.steps + 1))
        half, farthest = config.steps // 2, int(np.pi / step_rad)
        left, right = range(half + 1), range(-1, -farthest - 1, -1)
        visited: list[int] = []
        for step in (*left, *right, *range(half + 1, farthest + 1)):
            if views > config.steps or self._log_odds[index] <= GIVE_UP_LOG_ODDS:
                return
            row = self._choose_position(index, positions, visited, start + step * step_rad)
            if row is not None:
                visited.append(row)
                if self._take_near(earlier, positions[row], index):
                    views += 1
                    continue
                views += self._observe_from(positions[row], index)
                self._progress()
        if not visited and not views:
            self.skipped.append("no position around it is reachable")

    def _use_recorded(self, index: int) -> int:
        """Add recorded frames of a region from positions as different as possible; count them."""
        region = self.regions[index]
        frames = [frame for frame, whole in self._recorded.items() if is_visible(whole, region)]
        positions = np.array([f.camera.world_from_camera[:3, 3] for f in frames]).reshape(-1, 3)
        rows = farthest_points(positions, self._config.steps + 1)
        return sum(self._add(frames[row], index) for row in sorted(rows))

    def _take_near(self, frames: list[RgbdFrame], position: Floats, index: int) -> bool:
        """Take one of some frames that shows a region from near a position; return if there is."""
        for row, frame in enumerate(frames):
            off_m = np.linalg.norm(frame.camera.world_from_camera[:2, 3] - position)
            if off_m < self._config.step_m and is_visible(frame, self.regions[index]):
                frames.pop(row)
                return True
        return False

    def _choose_position(
        self, index: int, positions: Floats, visited: list[int], bearing: float
    ) -> int | None:
        """Return the row of the best position in a direction from the region; None if none fits."""
        region, config = self.regions[index], self._config
        metres, bearings = _polar(positions, region)
        off_rad = np.abs((bearings - bearing + np.pi) % (2 * np.pi) - np.pi)
        fits = _is_suitable(metres) & (off_rad <= config.step_m / config.distance_m)
        fits[visited] = False
        if not fits.any():
            return None
        distance_m = max(config.distance_m, float(np.linalg.norm(region.high - region.low)))
        off_m = np.hypot(metres - distance_m, metres * off_rad)
        return int(np.argmin(np.where(fits, off_m, np.inf)))

    def _observe_from(self, position: Floats, index: int) -> bool:
        """Move to a position and observe the region; return whether the frame counts."""
        region = self.regions[index]
        direction = region.center[:2] - position
        camera_m = float(self._robot.pose()[2, 3])
        pitch_rad = float(np.arctan2(camera_m - region.center[2], np.linalg.norm(direction)))
        if not self._robot.move_towards(position, _bearing(direction), pitch_rad):
            self.skipped.append(f"the robot did not reach ({position[0]:.2f}, {position[1]:.2f})")
            return False
        return self._add(self._robot.observe(), index)

    def _add(self, frame: RgbdFrame, index: int) -> bool:
        """Keep a new frame that shows a region; return whether it shows this one."""
        if any(frame is other for other in self._observed):  # A recording has no other frame there.
            return False
        self._observed.append(frame)
        frame = frame.registered()
        name = f"frame {len(self._observed)}"
        shown = [is_visible(frame, region) for region in self.regions]
        if not any(shown):
            side = self.regions[index].side
            self.skipped.append(f"{name}: it does not show the {side} region")
            return False
        detection = self._detector.detect(frame)
        if detection.unreliable is not None:
            self.skipped.append(f"{name}: {detection.unreliable}")
            return False
        self.frames.append((frame, detection))
        # Not those of other regions, which this frame may show from far away.
        evidence = evidence_of(self.regions[index], detection)
        if shown[index] and not isinstance(evidence, str):
            self._log_odds[index] += evidence
        for row, reported in enumerate(self._reported):  # Grown ones would grow on and on.
            own = [surface for surface in detection.surfaces if reported.matches(surface)]
            self.regions[row] = self.regions[row].include(
                (surface.low for surface in own), (surface.high for surface in own)
            )
        return shown[index]


def _bearing(direction: Floats) -> float:
    return float(np.arctan2(direction[1], direction[0]))


def _polar(positions: Floats, region: Region) -> tuple[Floats, Floats]:
    """Return [P] distances, m, and [P] bearings, rad, of positions [P,2] from a region."""
    directions = positions - region.center[:2]
    return np.linalg.norm(directions, axis=1), np.arctan2(directions[:, 1], directions[:, 0])


def _is_suitable(metres: Floats) -> Bools:
    """Return [P] whether a camera at these distances measures a region well."""
    return np.asarray((metres >= MIN_DISTANCE_M) & (metres <= FAR_M), np.bool_)


def _reachable_angle(positions: Floats, region: Region, sector_rad: float) -> float:
    """Return the sum of the sectors around a region that hold a suitable position [P,2], rad."""
    metres, bearings = _polar(positions, region)
    sectors = int(np.ceil(2 * np.pi / sector_rad))
    turns = (bearings[_is_suitable(metres)] + np.pi) / (2 * np.pi)
    return 2 * np.pi * len(np.unique((turns * sectors).astype(int))) / sectors
