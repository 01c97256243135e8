"""Poses of a running robot from tf: over the last seconds, at little cost, as tf2 finds them."""

from typing import Any

import numpy as np
import pytest
from ros_bags import START_NS, Recorder

from gslts.datasets.ros.poses import FrameTree, Track
from gslts.ros.constants import POSE_HISTORY_NS
from gslts.ros.live_poses import TfPoses

MS = 1_000_000
RECORDER = Recorder()


def transform(ms: int, parent: str, child: str, x_m: float = 0.0) -> Any:
    pose = np.eye(4)
    pose[0, 3] = x_m
    return RECORDER.transform(START_NS + ms * MS, parent, child, pose)


def message(*transforms: Any) -> Any:
    return RECORDER.make("tf2_msgs/msg/TFMessage", transforms=list(transforms))


def x_at(poses: TfPoses, ms: int, frame: str = "camera") -> float:
    return float(poses.at(START_NS + ms * MS, frame)[0, 3])


def test_a_pose_is_that_between_its_neighbours() -> None:
    """Whatever their order, and of several poses at one time the first one."""
    rng = np.random.default_rng(0)
    track, poses = Track(), {}
    for ms in rng.integers(0, 500, 300).tolist():
        x_m = float(rng.uniform())
        pose = transform(0, "", "", x_m).transform
        track.add(ms, pose.translation, pose.rotation)
        poses.setdefault(ms, x_m)
    for first, last in ((0, 500), (100, 400), (390, 395), (398, 397)):
        track.keep(first, last)
        before = max(ms for ms in poses if ms <= last)
        poses = {ms: x for ms, x in poses.items() if first <= ms <= last} or {before: poses[before]}
        assert track.newest_ns() == max(poses)
        for ms in range(min(poses), max(poses) + 1):
            expected = np.interp(ms, sorted(poses), [poses[each] for each in sorted(poses)])
            assert track.at(ms)[0, 3] == pytest.approx(expected)
        for ms in (min(poses) - 1, max(poses) + 1):
            with pytest.raises(ValueError, match="there are no two poses around it"):
                track.at(ms)


def test_old_poses_are_removed_once_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    removals: list[int] = []
    monkeypatch.setattr(FrameTree, "keep", lambda *ends: removals.append(ends[-1]))
    joints, poses = [f"joint_{number}" for number in range(30)], TfPoses("map")
    for ms in range(0, 5_000, 20):
        transforms = [transform(ms, "base_link", joint) for joint in joints]
        poses.add(message(*transforms), fixed=False)
    assert np.diff(removals).tolist() == 4 * [1000 * MS]


def test_old_poses_are_forgotten() -> None:
    poses = TfPoses("map")
    for ms in range(0, 20_000, 100):
        poses.add(message(transform(ms, "map", "camera", ms / 1000)), fixed=False)
    assert x_at(poses, 11_950) == pytest.approx(11.95)
    with pytest.raises(ValueError, match="there are no two poses around it"):
        x_at(poses, 19_900 - POSE_HISTORY_NS // MS - 1500)


def test_poses_of_all_frames_end_where_the_clock_was_set_back_to() -> None:
    poses = TfPoses("map")
    for ms in range(60_000, 62_000, 100):
        each = (transform(ms, "map", "base_link", 1.0), transform(ms, "base_link", "camera", 1.0))
        poses.add(message(*each), fixed=False)
    poses.add(message(transform(0, "map", "base_link", 5.0)), fixed=False)
    for ms in range(100, 61_500, 100):
        each = (transform(ms, "map", "base_link", 5.0), transform(ms, "base_link", "camera", 2.0))
        poses.add(message(*each), fixed=False)
    assert x_at(poses, 61_350) == 7.0


def test_a_frame_moves_to_the_parent_of_its_last_transform() -> None:
    poses = TfPoses("map")
    poses.add(message(transform(0, "map", "table", 4.0)), fixed=True)
    for ms in (0, 100):
        poses.add(message(transform(ms, "map", "camera", 1.0)), fixed=False)
    assert x_at(poses, 50) == 1.0
    both = message(transform(200, "table", "camera", 2.0), transform(200, "map", "lamp"))
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        poses.add(both, fixed=False)
    assert str(caught.value) == (
        "the frame camera has two parents: map (moving) and table (moving); the last one holds"
    )
    with pytest.raises(ValueError, match="there are no two poses around it"):
        x_at(poses, 150)
    poses.add(message(transform(300, "table", "camera", 2.0)), fixed=False)
    assert x_at(poses, 250) == 6.0
    assert x_at(poses, 200, "lamp") == 0.0
    with pytest.raises(ValueError, match=r"table \(moving\) and map \(fixed\); the last one"):
        poses.add(message(transform(0, "map", "camera", 3.0)), fixed=True)
    assert x_at(poses, 250) == 3.0
