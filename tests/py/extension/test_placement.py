"""Placement of a recording in a map that knows a part of what it shows."""

from collections.abc import Sequence
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from change_room import home, mapped, see
from store_maps import random_map

from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import relative
from gslts.extension.placement import place_frames
from gslts.localization.relocalizer import Localization, Relocalizer
from gslts.mapping.observation import Observation
from gslts.trajectory.drift import DriftingPoses
from gslts.types import Floats
from gslts_sim.robot_body import Viewpoint

TO_KNOWN = (Viewpoint(2.4, 2.8, 180.0, 20.0), Viewpoint(2.2, 0.8, 180.0, 20.0))
TO_UNKNOWN = (Viewpoint(2.0, 2.8, 0.0, 20.0), Viewpoint(2.2, 1.0, 0.0, 20.0))


class Recorder(Relocalizer):
    """Notes the poses near which frames are localized."""

    def __init__(self) -> None:
        gaussian_map, _ = mapped()
        super().__init__(gaussian_map.select(gaussian_map.means[:, 0] < 2.4), None)
        self.tracked: list[Floats] = []

    def track(self, frame: RgbdFrame, world_from_camera: Floats) -> Localization:
        self.tracked.append(world_from_camera)
        return super().track(frame, world_from_camera)


def test_frames_are_tracked_only_where_the_map_may_show_them() -> None:
    frames = {
        str(k): Observation.of(see(home(), viewpoint))
        for k, viewpoint in enumerate((*TO_KNOWN, *TO_UNKNOWN))
    }
    relocalizer = Recorder()
    placement = place_frames(frames, relocalizer)
    assert placement.anchors == ("0", "1")
    assert list(placement.frames) == ["0", "1", "2", "3"], "others are placed by the given poses"
    poses = [frame.world_from_camera for frame in frames.values()]
    assert len(relocalizer.tracked) == 2
    assert np.allclose(relocalizer.tracked, poses[:2])


STEP_M, OFF_M = 0.05, 5.0
"""Distance of frames that follow each other, and of outliers from where they should be, m."""


def pose_at(k: int, off_m: float = 0.0) -> Floats:
    pose = np.eye(4)
    pose[:2, 3] = STEP_M * k, off_m
    return pose


class Displaced:
    """A relocalizer that displaces some frames of a straight path."""

    def __init__(self, rows: Sequence[int]) -> None:
        self.gaussian_map, self.config = random_map(1), SimpleNamespace(threads=1)
        self.rows = set(rows)

    def localize(self, frame: RgbdFrame) -> Localization:
        k = round(frame.camera.world_from_camera[0, 3] / STEP_M)
        return Localization("ok", "", pose_at(k, OFF_M * (k in self.rows)))

    def track(self, frame: RgbdFrame, _: Floats) -> Localization:
        return self.localize(frame)


def outliers(count: int, displaced: Sequence[int]) -> set[int]:
    """Return the frames that contradict those on both sides, one removed after the other."""
    given = DriftingPoses([pose_at(k) for k in range(count)])
    found = {k: pose_at(k, OFF_M * (k in displaced)) for k in range(count)}
    while True:
        agree = {
            pair: given.allows(*pair, relative(found[pair[0]], found[pair[1]]))
            for pair in pairwise(found)
        }
        alone = [k for k in found if not any(agree[pair] for pair in agree if k in pair)]
        if not alone or len(found) == 1:
            return set(range(count)) - set(found)
        del found[alone[0]]


@pytest.mark.parametrize(
    "displaced",
    [[], [0], [119], [7, 20, 21, 22, 60], [1, 3, 5, 7, 9], range(0, 120, 6), [117, 118]],
    ids=str,
)
def test_frames_that_contradict_both_sides_are_left_out(
    displaced: Sequence[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    count, tests = 120, []
    allows = DriftingPoses.allows

    def note(self: DriftingPoses, a: int, b: int, motion: Floats) -> bool:
        tests.append((a, b))
        return allows(self, a, b, motion)

    expected = outliers(count, displaced)
    monkeypatch.setattr(DriftingPoses, "allows", note)
    camera = Camera(fx=8, fy=8, cx=4, cy=3, width=8, height=6, world_from_camera=np.eye(4))
    rgb, depth = np.zeros((6, 8, 3), np.uint8), np.zeros((6, 8), np.float32)
    frames = {
        str(k): Observation.of(RgbdFrame(rgb, depth, at_pose(camera, pose_at(k))))
        for k in range(count)
    }
    placement = place_frames(frames, Displaced(displaced))
    assert {int(name) for name in frames if name not in placement.anchors} == expected
    assert len(tests) < 3 * count, "only the pairs beside an outlier are tested again"
