"""Placement of a recording in the frame of a map.

Frames that show known space are localized in the map: they are anchors. The motion between frames
is that of the recording's own poses, corrected so that it meets the anchors on both sides.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gslts.core.camera import at_pose, downscale
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import product, relative, se3_retract, twist_of
from gslts.extension.constants import (
    MAX_OUTLIER_SHARE,
    MAX_SCALE_ERROR,
    MAX_SCOUTS,
    MIN_ANCHORS,
    MIN_KNOWN_ALPHA,
    MIN_OUTLIERS,
    MIN_SIGHT_SHARE,
    MIN_STEP_M,
    MIN_STEPS,
    SIGHT_MARGIN_M,
    SIGHT_WIDTH_PX,
)
from gslts.localization.relocalizer import Localization, Relocalizer
from gslts.mapping.observation import Observation
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.trajectory.drift import DriftingPoses
from gslts.types import Floats


@dataclass(frozen=True, eq=False)
class Placement:
    """A recording in the frame of a map.

    Attributes:
        frames: Frames at their poses in the map, by name, in the order of the recording.
        anchors: Names of those that were localized in the map.
        unplaced: Frames without a pose in the map, and why.
    """

    frames: Mapping[str, Observation]
    anchors: tuple[str, ...]
    unplaced: tuple[str, ...]


def place_frames(
    frames: Mapping[str, Observation],
    relocalizer: Relocalizer,
    on_frame: Callable[[], None] = lambda: None,
) -> Placement:
    """Find the poses of the frames of a recording in a map.

    The recording may be in any world frame, and its poses may drift.

    Args:
        frames: By name, in the order of the recording, at its poses.
        relocalizer: Of the map.
        on_frame: Called after each frame that was compared with the map.

    Raises:
        ValueError: Too few frames show what the map knows, or their poses contradict it.
    """
    track = _Track(list(frames.values()), relocalizer, on_frame)
    track.find_scouts()
    track.drop_outliers()
    if track.anchors:  # Between the scouts there may be more, such as the first frames of a robot.
        track.track_others()
        track.drop_outliers()
    if len(track.anchors) < MIN_ANCHORS:
        raise ValueError(
            f"{len(track.anchors)} of {len(frames)} frames show what the map knows, {MIN_ANCHORS} "
            "are needed: is it of another scene? Record frames that also show a part of the map"
        )
    track.require_consistent()
    names, placed, unplaced = list(frames), {}, []
    for k, name in enumerate(names):
        if k in track.outliers:
            unplaced.append(f"{name}: the map shows it elsewhere than its pose says")
            continue
        gap = track.broken_gap(k)
        if gap is None:
            placed[name] = _move(track.frames[k], track.pose(k))
        else:
            before, after = (names[end] for end in gap)
            unplaced.append(f"{name}: between {before} and {after}, its poses contradict the map")
    return Placement(placed, tuple(names[k] for k in sorted(track.anchors)), tuple(unplaced))


class _Track:
    """Poses of F frames in the map: `anchors` by index, and those between them.

    `outliers` are localized in the map, and contradict the anchors on both sides.
    """

    def __init__(
        self, frames: list[Observation], relocalizer: Relocalizer, on_frame: Callable[[], None]
    ) -> None:
        self.frames, self.anchors, self.outliers = frames, dict[int, Floats](), set[int]()
        self._relocalizer, self._on_frame = relocalizer, on_frame
        self._rasterizer = Rasterizer(np.float32)
        self._given = DriftingPoses([frame.world_from_camera for frame in frames])

    def find_scouts(self) -> None:
        """Localize some frames: near the given poses, or anywhere if these are of another world."""
        count = len(self.frames)
        scouts = np.unique(np.linspace(0, count - 1, min(count, MAX_SCOUTS)).astype(int))
        for k in scouts.tolist():
            if not self._track(k, self.frames[k].world_from_camera):
                self._keep(k, self._relocalizer.localize(self._frame(k)))
            self._on_frame()

    def track_others(self) -> None:
        """Localize all other frames, from where their neighbours are."""
        for k in range(len(self.frames)):
            if k not in self.anchors:
                self._track(k, self.pose(k))
                self._on_frame()

    def drop_outliers(self) -> None:
        """Make outliers of the anchors that contradict those on both sides."""
        ends = sorted(self.anchors)
        # Before each end and after the last one: True if there is none, or it contradicts.
        faults = [True, *(not self._agree(a, b) for a, b in pairwise(ends)), True]
        row = 0
        while row < len(ends) and len(ends) > 1:
            if not (faults[row] and faults[row + 1]):
                row += 1
                continue
            alone = ends.pop(row)
            del self.anchors[alone]
            self.outliers.add(alone)
            is_between = 0 < row < len(ends)
            faults[row : row + 2] = [not (is_between and self._agree(ends[row - 1], ends[row]))]
            row = max(0, row - 1)

    def require_consistent(self) -> None:
        """Raise ValueError if the map contradicts many of the given poses, or their scale."""
        count, localized = len(self.outliers), len(self.outliers) + len(self.anchors)
        if count >= MIN_OUTLIERS and count > MAX_OUTLIER_SHARE * localized:
            raise ValueError(
                f"{count} of {localized} frames that show what the map knows are elsewhere than "
                "the poses of the recording say: try --poses correct or --poses estimate"
            )
        steps = [
            (self._given.motion(a, b)[:3, 3], relative(self.anchors[a], self.anchors[b])[:3, 3])
            for a, b in pairwise(sorted(self.anchors))
        ]
        given_m, true_m = np.linalg.norm(np.reshape(steps, (-1, 2, 3)), axis=2).T
        is_long = true_m >= MIN_STEP_M
        if np.count_nonzero(is_long) < MIN_STEPS:
            return
        scale = float(np.median(given_m[is_long] / true_m[is_long]))
        if abs(scale - 1) > MAX_SCALE_ERROR:
            raise ValueError(
                f"the poses of the recording are {scale:.2f} times as far apart as the map says: "
                "they have another scale; --poses estimate takes it from the depth"
            )

    def pose(self, k: int) -> Floats:
        """Return the pose [4,4] of a frame, from the anchors around it."""
        if k in self.anchors:
            return self.anchors[k]
        before, after = self._around(k)
        poses = [self._from_anchor(end, k) for end in (before, after) if end is not None]
        if len(poses) == 1:
            return poses[0]
        assert before is not None
        assert after is not None
        length_m = self._given.path_m(before, after)
        share = self._given.path_m(before, k) / max(length_m, 1e-9)
        return se3_retract(poses[0], share * twist_of(relative(poses[0], poses[1])))

    def broken_gap(self, k: int) -> tuple[int, int] | None:
        """Return the anchors around a frame if the given poses between them contradict them."""
        before, after = self._around(k)
        if k in self.anchors or before is None or after is None or self._agree(before, after):
            return None
        return before, after

    def _track(self, k: int, predicted: Floats) -> bool:
        """Localize a frame near a predicted pose [4,4], if the map may show it there."""
        frame = self._frame(k)
        if not self._may_show(frame, predicted):
            return False
        return self._keep(k, self._relocalizer.track(frame, predicted))

    def _may_show(self, frame: RgbdFrame, predicted: Floats) -> bool:
        """Test if enough of the depth is near what the map shows at a pose [4,4]."""
        divisor = max(1, frame.camera.width // SIGHT_WIDTH_PX)
        camera = downscale(at_pose(frame.camera, predicted), divisor)
        options = RenderOptions(threads=self._relocalizer.config.threads)
        images = self._rasterizer.forward(self._relocalizer.gaussian_map, camera, options)
        middle = slice(divisor // 2, None, divisor)
        depth = frame.depth[middle, middle][: camera.height, : camera.width]
        near = np.abs(images.depth - depth) < SIGHT_MARGIN_M
        near &= images.alpha >= MIN_KNOWN_ALPHA
        measured = depth > 0
        return not measured.any() or float(near[measured].mean()) >= MIN_SIGHT_SHARE

    def _keep(self, k: int, found: Localization) -> bool:
        """Keep the pose of a frame if the map determines it."""
        if found.status != "ok" or found.world_from_camera is None:
            return False
        self.anchors[k] = found.world_from_camera
        self.outliers.discard(k)
        return True

    def _frame(self, k: int) -> RgbdFrame:
        return self.frames[k].rgbd()

    def _around(self, k: int) -> tuple[int | None, int | None]:
        before = max((end for end in self.anchors if end < k), default=None)
        return before, min((end for end in self.anchors if end > k), default=None)

    def _from_anchor(self, anchor: int, k: int) -> Floats:
        return product(self.anchors[anchor], self._given.motion(anchor, k))

    def _agree(self, a: int, b: int) -> bool:
        """Test if the motion between two anchors is that of the given poses, up to drift."""
        return self._given.allows(a, b, relative(self.anchors[a], self.anchors[b]))


def _move(frame: Observation, world_from_camera: Floats) -> Observation:
    """Return a frame whose given pose is that in the map."""
    motion = product(world_from_camera, relative(frame.world_from_camera, np.eye(4)))
    return replace(
        frame,
        given_world_from_depth=product(motion, frame.given_world_from_depth),
        world_from_camera=world_from_camera,
    )
