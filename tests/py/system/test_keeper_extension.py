"""A keeper whose map grows: unmapped space that a robot can reach, and recordings that show it."""

import json
from dataclasses import replace
from pathlib import Path

import adrift
import change_room
import half_room
import numpy as np
import pytest
from command import gslts as run

from gslts.change.visibility import Visibility
from gslts.datasets import open_dataset
from gslts.keeper.config import KeeperConfig
from gslts.keeper.exploration import look_around, plan_exploration
from gslts.keeper.keeper import MapKeeper, StoppedError
from gslts.robots.localized import localized
from gslts.store.camera_files import cameras_of_map
from gslts.store.causes import ExtensionCause
from gslts.store.map_folder import open_map, read_map
from gslts_sim.controller import Controller

NEAR_M = 1.7
"""The map is of frames that look at smaller x only, m."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return half_room.map_of_half(tmp_path / "map", NEAR_M)


def robot() -> Controller:
    return Controller(change_room.home(), **change_room.SIZE, noise="none")


def seen_by_cameras_of(folder: Path) -> Visibility:
    return Visibility(read_map(folder), cameras_of_map(folder).values())


def test_positions_that_no_camera_saw_are_explored(folder):
    driven, visibility = robot(), seen_by_cameras_of(folder)
    positions = plan_exploration(driven, visibility)
    assert len(positions) >= 3
    reachable = driven.reachable_positions()
    assert all((reachable == position).all(axis=1).any() for position in positions)
    height_m = driven.pose()[2, 3]
    points = np.column_stack([positions, np.full(len(positions), height_m)])
    counts = visibility.counts(points, np.full(len(points), 3.0))
    known = counts.through + counts.on >= 2
    assert not known.any()
    cameras = list(cameras_of_map(folder).values())
    frames = list(look_around(driven, positions[:2], cameras))
    assert len(frames) == 4 + 2 * 12 + 4
    ahead = np.array([frame.camera.world_from_camera[:3, 2] for frame in frames])
    assert np.linalg.norm(ahead[4:16].mean(axis=0)[:2]) < 0.05, "all around"
    centres = np.array([camera.world_from_camera[:2, 3] for camera in cameras])
    for frame in (*frames[:4], *frames[-4:]):
        position = frame.camera.world_from_camera[:2, 3]
        assert np.linalg.norm(centres - position, axis=1).min() < 0.02, "as the map was made"


def test_nothing_is_explored_in_a_known_room():
    gaussian_map, cameras = change_room.mapped()
    assert len(plan_exploration(robot(), Visibility(gaussian_map, cameras.values()))) == 0


def test_a_robot_maps_unmapped_space(folder):
    lines: list[str] = []
    config = KeeperConfig(extension=half_room.CONFIG)
    before = read_map(folder)
    with MapKeeper(folder, config, log=lines.append) as keeper:
        keeper.explore(robot())
        after, version = keeper.gaussian_map, keeper.version
        assert lines[0].startswith("unmapped space: exploring ")
        assert lines[1].startswith("version 2: ")
        keeper.watch(robot().observe())
    assert isinstance(version.cause, ExtensionCause)
    assert after.size > 1.3 * before.size
    far, known = ((gaussians.means[:, 0] > 3.5).sum() for gaussians in (after, before))
    assert far > 3 * known
    with open_map(folder) as store:
        assert store.find_problems() == []
    visibility = seen_by_cameras_of(folder)
    assert len(plan_exploration(robot(), visibility)) == 0, "it is known now"


def test_a_robot_whose_odometry_drifted_maps_unmapped_space(folder):
    config = KeeperConfig(extension=half_room.CONFIG, relocalization=adrift.CONFIG)
    before = read_map(folder)
    with MapKeeper(folder, config) as keeper:
        keeper.explore(localized(adrift.Adrift(robot()), keeper.localizer))
        new = keeper.gaussian_map.means[before.size :]
    low, high = change_room.home().rooms[0].box
    assert (new[:, 0] > 3.5).sum() > 1000
    assert ((new > low - 0.1) & (new < high + 0.1)).all(axis=1).mean() > 0.98
    assert len(plan_exploration(robot(), seen_by_cameras_of(folder))) == 0, "it is known now"


def test_a_stop_leaves_the_map_as_it_was(folder):
    with MapKeeper(folder, KeeperConfig(), should_stop=lambda: True) as keeper:
        with pytest.raises(StoppedError):
            keeper.explore(robot())
        assert keeper.version.number == 1


def test_frames_of_another_place_do_not_extend(folder, tmp_path):
    half_room.recording(tmp_path / "visit")
    frames = {frame.name: frame.read() for frame in open_dataset(tmp_path / "visit").frames[:4]}
    dark = {
        name: replace(frame, rgb=np.zeros_like(frame.rgb), depth=np.zeros_like(frame.depth))
        for name, frame in frames.items()
    }
    lines: list[str] = []
    with MapKeeper(folder, KeeperConfig(), log=lines.append) as keeper:
        keeper.extend(dark, "visit")
        assert keeper.version.number == 1
    assert lines == [
        "not extended: 0 of 4 frames show what the map knows, 2 are needed: is it of another "
        "scene? Record frames that also show a part of the map"
    ]


@pytest.mark.parametrize("localize", [(), ("--localize",)])
def test_a_recording_extends_the_map_of_a_command(folder, tmp_path, localize):
    """Also by frames that show nothing of the map, and thus are not localized."""
    half_room.recording(tmp_path / "visit")
    before = read_map(folder)
    options = ("--extend", "--iterations", "20", *localize)
    done = run("run", "map", "--frames", "visit", *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    far, known = ((gaussians.means[:, 0] > 3.5).sum() for gaussians in (read_map(folder), before))
    assert far > 3 * known
    assert "Gaussians added" in done.stdout
    with open_map(folder) as store:
        assert isinstance(store.version().cause, ExtensionCause)
        assert store.version().cause.dataset == "visit"


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("posed", [0, 3])
def test_frames_without_poses_do_not_extend(tmp_path, posed):
    visit = half_room.recording(tmp_path / "visit")
    content = json.loads((visit / "transforms.json").read_text())
    content["frames"] = content["frames"][:8]
    for frame in content["frames"][posed:]:
        del frame["transform_matrix"]
    (visit / "transforms.json").write_text(json.dumps(content))
    options = ("--extend", "--localize", "--iterations", "20")
    done = run("run", "map", "--frames", "visit", *options, cwd=tmp_path)
    hint = "gslts extend MAP visit --poses estimate finds poses by the images"
    if posed:
        assert done.returncode == 0, done.stderr
        assert f"5 frames have no pose and extend no map; {hint}\n" in done.stderr
    else:
        assert done.returncode == 1
        why = "its frames have no poses, which --extend needs"
        assert done.stderr == f"gslts: visit: {why}; {hint}\n"
