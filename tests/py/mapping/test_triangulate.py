"""Keypoints, matches, tracks and triangulated points of posed images."""

from dataclasses import replace
from pathlib import Path

import blob_room
import cv2
import numpy as np
import pytest
import sim_scenes

from gslts.core.camera import Camera, at_pose, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import rotation
from gslts.datasets import open_dataset
from gslts.mapping.seeding import sift
from gslts.mapping.seeding.matching import MAX_VIEW_ANGLE_RAD, Matches, build_tracks, choose_pairs
from gslts.mapping.seeding.sift import MASK_MARGIN_PX, detect_keypoints
from gslts.mapping.seeding.triangulate import triangulate
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.explore import explore
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint


@pytest.fixture(scope="module")
def frames() -> list[RgbdFrame]:
    return [blob_room.frame(camera) for camera in blob_room.cameras()]


def shifted(frame: RgbdFrame, by_px: float) -> RgbdFrame:
    camera = frame.camera
    moved = Camera(
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx + by_px,
        cy=camera.cy + by_px,
        width=camera.width,
        height=camera.height,
        world_from_camera=camera.world_from_camera,
    )
    return replace(frame, camera=moved)


@pytest.mark.parametrize("longest_px", [240, 239], ids=["full", "halved"])
def test_keypoints_are_at_the_spots(longest_px: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sift, "MAX_SIDE_PX", longest_px)
    frame = blob_room.frame(blob_room.camera_at((0.5, 0.8, 1.4), 0.5))
    camera = frame.camera
    pose = camera.world_from_camera
    in_camera = (blob_room.SPOTS[0] - pose[:3, 3]) @ pose[:3, :3]
    spots = in_camera[:, :2] / in_camera[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    places = detect_keypoints(frame).positions
    off = places[:, None] - spots
    nearest = off[np.arange(len(off)), np.linalg.norm(off, axis=2).argmin(axis=1)]
    own = nearest[np.abs(nearest).max(axis=1) < 1]
    assert len(own) > 50
    # Where spots overlap, keypoints are off in all directions alike.
    assert np.abs(np.median(own, axis=0)).max() < 0.12


def test_points_lie_on_surfaces_at_keypoints(frames: list[RgbdFrame]) -> None:
    cloud = triangulate(frames)
    assert len(cloud.points) > 100
    off = blob_room.from_planes(cloud.points)
    assert np.median(off) < 5e-3
    assert np.quantile(off, 0.95) < 0.03
    assert np.median(blob_room.from_spots(cloud.points)) < 0.012
    # The spots are of 8 colours on grey.
    nearest = np.linalg.norm(cloud.points[:, None] - blob_room.SPOTS[0], axis=2)
    own = nearest.min(axis=1) < 0.01
    signs = np.sign(blob_room.SPOTS[2][nearest.argmin(axis=1)])
    agree = np.sign(cloud.colors / 255 - 0.5) == signs
    assert agree[own].mean() > 0.9


def test_half_a_pixel_and_the_wrong_handedness_fail(frames: list[RgbdFrame]) -> None:
    """Either mistake exceeds the bounds of the tests above."""
    cloud = triangulate([shifted(frame, 0.5) for frame in frames])
    assert np.median(blob_room.from_planes(cloud.points)) > 0.01
    cloud = triangulate([replace(frame, rgb=frame.rgb[:, ::-1].copy()) for frame in frames])
    assert len(cloud.points) < 50 or np.median(blob_room.from_planes(cloud.points)) > 0.1


def test_two_images_are_enough(frames: list[RgbdFrame]) -> None:
    cloud = triangulate([frames[0], frames[5]])
    assert len(cloud.points) > 15
    assert np.median(blob_room.from_planes(cloud.points)) < 0.02
    assert len(triangulate(frames[:1]).points) == 0
    assert len(triangulate([]).points) == 0
    assert len(triangulate([frames[0], frames[0]]).points) == 0, "there is no baseline"


def test_poses_may_be_a_little_off(frames: list[RgbdFrame]) -> None:
    rng = np.random.default_rng(0)
    moved = []
    for frame in frames:
        pose = frame.camera.world_from_camera
        pose[:3, 3] += 0.01 * rng.standard_normal(3)
        pose[:3, :3] = pose[:3, :3] @ rotation(0.005 * rng.standard_normal(3))
        moved.append(replace(frame, camera=at_pose(frame.camera, pose)))
    cloud = triangulate(moved)
    assert len(cloud.points) > 0.5 * len(triangulate(frames).points)
    assert np.median(blob_room.from_planes(cloud.points)) < 0.05


def test_what_a_mask_hides_gives_no_points(frames: list[RgbdFrame]) -> None:
    mask = np.zeros(frames[0].rgb.shape[:2], np.bool_)
    mask[20:160, 60:220] = True
    masked = [
        replace(frame, rgb=np.where(mask[..., None], frame.rgb, 0).astype(np.uint8), mask=mask)
        for frame in frames
    ]
    columns, rows = detect_keypoints(masked[0]).positions.T
    assert len(columns) > 30
    assert columns.min() > 60 + MASK_MARGIN_PX - 1
    assert columns.max() < 220 - MASK_MARGIN_PX + 1
    assert rows.min() > 20 + MASK_MARGIN_PX - 1
    assert rows.max() < 160 - MASK_MARGIN_PX + 1
    assert np.median(blob_room.from_planes(triangulate(masked).points)) < 5e-3
    nothing = [replace(frame, mask=np.zeros_like(mask)) for frame in frames]
    assert len(triangulate(nothing).points) == 0


def test_nothing_comes_of_white_walls(frames: list[RgbdFrame]) -> None:
    white = [replace(frame, rgb=np.full_like(frame.rgb, 230)) for frame in frames]
    assert len(triangulate(white).points) == 0
    assert len(triangulate([*white[:4], *frames[4:]]).points) > 10


def test_threads_change_nothing(frames: list[RgbdFrame]) -> None:
    threads = cv2.getNumThreads()
    try:
        clouds = []
        for count in (1, 4):
            cv2.setNumThreads(count)
            clouds.append(triangulate(frames))
    finally:
        cv2.setNumThreads(threads)
    assert clouds[0].points.tobytes() == clouds[1].points.tobytes()
    assert clouds[0].colors.tobytes() == clouds[1].colors.tobytes()


@pytest.fixture(scope="module")
def visit() -> tuple[Home, list[Viewpoint]]:
    """Return a room whose walls look different everywhere, and views of it."""
    rng = np.random.default_rng(0)
    wall = rng.integers(40, 220, (96, 96, 3)).astype(np.uint8).repeat(4, 0).repeat(4, 1)
    home = sim_scenes.simple_home(wall=wall)
    walls = home["Wall|1"]
    # The texture repeats every 5 m instead of every metre: nothing repeats within the room.
    surfaces = tuple(
        replace(surface, uvs=surface.uvs / np.float32(5)) for surface in walls.surfaces
    )
    home = replace(home, objects=(replace(walls, surfaces=surfaces), *home.objects[1:]))
    return home, explore(home, 24)[0]


@pytest.mark.parametrize("noise", ["none", "kinect"])
def test_points_of_a_simulated_visit(
    noise: str, visit: tuple[Home, list[Viewpoint]], tmp_path: Path
) -> None:
    home, viewpoints = visit
    capture(Controller(home, width=320, height=240, noise=noise), viewpoints, tmp_path / "visit")
    frames = [frame.read() for frame in open_dataset(tmp_path / "visit").frames]
    blind = [
        RgbdFrame(frame.rgb, np.zeros(frame.rgb.shape[:2], np.float32), frame.camera)
        for frame in frames
    ]
    points = triangulate(blind).points
    assert len(points) > 300
    room = np.abs(np.stack([points, np.array([5, 4, 2.6]) - points])).min(axis=(0, 2))
    low, high = np.array([2.0, 1.5, 0]), np.array([3.2, 2.3, 0.75])
    block = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=1)
    off = np.minimum(room, block)
    median_m, most_m = {"none": (2e-3, 0.03), "kinect": (0.03, 0.15)}[noise]
    assert np.median(off) < median_m
    assert np.quantile(off, 0.95) < most_m


def test_partners_have_the_same_direction_from_another_position() -> None:
    def camera(place: tuple, turn_rad: float) -> Camera:
        x, y, z = place
        target = np.array([x + np.cos(turn_rad), y + np.sin(turn_rad), z])
        return at_pose(blob_room.camera_at((0, 0, 1)), look_at(np.array(place, float), target))

    line = [camera((0.1 * k, 0, 1), 0.0) for k in range(40)]
    others = [camera((0.5, 0, 1), 1.2 * MAX_VIEW_ANGLE_RAD), camera((0.5, 0, 1), 0.1)]
    found = choose_pairs([*line, *others])
    assert all(i < j for i, j in found)
    assert len(set(found)) == len(found) < 9 * 41
    partners = {j for i, j in found if i == 0}
    assert 1 in partners, "the next one"
    assert max(partners) >= 38, "a far one"
    assert 40 not in {j for pair in found for j in pair}, "it faces another direction"
    assert (5, 41) not in found, "it stands at the same place"
    assert choose_pairs([]) == [] == choose_pairs(line[:1])


def test_tracks_join_images_without_contradictory_matches() -> None:
    def matches(i: int, j: int, *rows: tuple[int, int, float]) -> Matches:
        table = np.array(rows)
        return Matches((i, j), table[:, :2].astype(np.intp), table[:, 2])

    # 0.0-1.0-2.0 is one point, 0.1-1.1 one that is too far off the line, and 0.2-1.2-0.3 is one in
    # whose first image it would be twice.
    table = [
        matches(0, 1, (0, 0, 0.1), (1, 1, 3.0), (2, 2, 0.0), (3, 2, 0.0)),
        matches(1, 2, (0, 0, 0.5), (2, 2, 0.5)),
    ]
    np.testing.assert_array_equal(
        build_tracks([4, 3, 3], table, 1.0),
        [[0, 0, 0], [0, 1, 0], [0, 2, 0], [1, 1, 2], [1, 2, 2]],
    )
    assert len(build_tracks([4, 3, 3], table, 4.0)) == 7
    assert build_tracks([0, 0], [], 1.0).shape == (0, 3)
    assert build_tracks([], [], 1.0).shape == (0, 3)
