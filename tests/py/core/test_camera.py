import pickle
from typing import Any

import numpy as np
import pytest
import scenes
from scipy.spatial.transform import Rotation

import gslts
from gslts.core.camera import TrainingCamera, at_pose, downscale, new_viewpoints, unproject
from gslts.core.se3 import rotation, rotation_vector

IDENTITY = np.eye(4)


def make_camera(**changes: Any) -> gslts.Camera:
    arguments: dict[str, Any] = {
        "fx": 100.0,
        "fy": 110.0,
        "cx": 31.0,
        "cy": 24.5,
        "width": 64,
        "height": 48,
        "world_from_camera": gslts.look_at((1, 2, 3), (0, 0, 0)),
    }
    return gslts.Camera(**(arguments | changes))


def test_camera_holds_what_it_was_given():
    pose = gslts.look_at((1, 2, 3), (0, 0, 0))
    camera = make_camera(world_from_camera=pose)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (100.0, 110.0, 31.0, 24.5)
    assert (camera.width, camera.height) == (64, 48)
    np.testing.assert_array_equal(camera.world_from_camera, pose)


def test_camera_is_immutable():
    camera = make_camera()
    with pytest.raises(AttributeError):
        camera.fx = 1.0  # type: ignore[misc]
    pose = camera.world_from_camera
    pose[0, 3] = 99
    assert camera.world_from_camera[0, 3] == 1


def test_camera_takes_a_transposed_pose():
    pose = gslts.look_at((1, 2, 3), (0, 0, 0))
    camera = make_camera(world_from_camera=np.asfortranarray(pose))
    np.testing.assert_array_equal(camera.world_from_camera, pose)


def test_equal_cameras_compare_equal():
    assert make_camera() == make_camera()
    assert make_camera() != make_camera(cx=31.5)
    assert make_camera() != make_camera(world_from_camera=IDENTITY)
    assert make_camera() != "camera"


def test_camera_survives_pickling():
    camera = make_camera()
    assert pickle.loads(pickle.dumps(camera)) == camera
    training = TrainingCamera(camera, 7)
    copy = pickle.loads(pickle.dumps(training))
    assert copy == training == camera
    assert copy.next_id == 7


def test_repr_shows_every_field():
    text = repr(make_camera(world_from_camera=IDENTITY))
    for part in ("fx=100.0", "fy=110.0", "cx=31.0", "cy=24.5", "width=64", "height=48", "[[1.0,"):
        assert part in text


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("fx", 0.0),
        ("fx", -1.0),
        ("fy", np.nan),
        ("fy", np.inf),
        ("cx", np.nan),
        ("cy", -np.inf),
        ("width", 0),
        ("height", 65537),
        ("world_from_camera", 2 * IDENTITY),
        ("world_from_camera", np.diag([1.0, 1, -1, 1])),
        ("world_from_camera", np.full((4, 4), np.nan)),
        ("world_from_camera", np.diag([1.0, 1, 1, 2])),
        ("world_from_camera", IDENTITY[:3]),
        ("world_from_camera", IDENTITY[None]),
        ("world_from_camera", IDENTITY.astype(np.float32)),
    ],
)
def test_bad_field_is_named(field, value):
    with pytest.raises(ValueError, match=field):
        make_camera(**{field: value})


@pytest.mark.parametrize("width", [64.0, np.float32(64.7), "64"])
def test_size_is_not_rounded(width):
    with pytest.raises(TypeError):
        make_camera(width=width)
    assert make_camera(width=np.int64(64)).width == 64


def test_field_of_view_spans_the_image():
    camera = gslts.camera_from_fov(640, 480, np.pi / 2)
    assert camera.fx == pytest.approx(320)
    assert camera.fy == camera.fx
    assert (camera.cx, camera.cy) == (320, 240)
    np.testing.assert_array_equal(camera.world_from_camera, IDENTITY)


@pytest.mark.parametrize("fov_rad", [0, -1, np.pi, np.nan])
def test_bad_field_of_view_is_named(fov_rad):
    with pytest.raises(ValueError, match="horizontal_fov_rad"):
        gslts.camera_from_fov(640, 480, fov_rad)


def test_a_crop_renders_the_part_of_the_image():
    # Of Gaussians whose centres lie in the part: beyond its margins 3DGS linearises elsewhere.
    gaussian_map = scenes.random_map(300, dtype=np.float64)
    near = np.flatnonzero(np.abs(gaussian_map.means).max(axis=1) < 0.4)
    gaussian_map = gaussian_map.select(near)
    assert len(near) > 50
    camera = scenes.orbit_camera(64, 48)
    whole = gslts.render(gaussian_map, camera).rgb
    part = gslts.render(gaussian_map, camera.cropped(12, 4, 60, 44)).rgb
    np.testing.assert_allclose(part, whole[4:44, 12:60], rtol=0, atol=1e-12)
    with pytest.raises(ValueError, match="columns 0 to 65"):
        camera.cropped(0, 0, 65, 48)


def test_look_at_has_opencv_axes():
    pose = gslts.look_at((0, -2, 0), (0, 0, 0))  # Looking along the world's +y.
    right, down, forward = pose[:3, 0], pose[:3, 1], pose[:3, 2]
    np.testing.assert_allclose(right, (1, 0, 0), atol=1e-15)
    np.testing.assert_allclose(down, (0, 0, -1), atol=1e-15)
    np.testing.assert_allclose(forward, (0, 1, 0), atol=1e-15)
    np.testing.assert_array_equal(pose[:3, 3], (0, -2, 0))


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (((1, 2, 3), (1, 2, 3)), "target"),
        (((0, 0, 0), (0, 0, 1)), "up"),
        (((0, 0, 0), (1, 0, 0), (0, 0, 0)), "up"),
        (((np.nan, 0, 0), (1, 0, 0)), "eye"),
    ],
)
def test_look_at_without_a_horizon_is_rejected(arguments, name):
    with pytest.raises(ValueError, match=name):
        gslts.look_at(*arguments)


def test_rotations_and_their_vectors() -> None:
    """Against scipy, and there and back."""
    for vector in (np.zeros(3), np.array([1e-9, 0, 0]), np.array([0.3, -1.2, 0.7])):
        turn = rotation(vector)
        np.testing.assert_allclose(turn, Rotation.from_rotvec(vector).as_matrix(), atol=1e-14)
        np.testing.assert_allclose(rotation_vector(turn), vector, atol=1e-12)


def test_cameras_elsewhere_and_of_smaller_images() -> None:
    camera = gslts.camera_from_fov(641, 480, 1.0, gslts.look_at((1, 2, 3), (4, 5, 3)))
    pose = gslts.look_at((0, 0, 1), (1, 0, 1))
    moved = at_pose(camera, pose)
    np.testing.assert_array_equal(moved.world_from_camera, pose)
    assert at_pose(moved, camera.world_from_camera) == camera
    half = downscale(camera, 2)
    assert (half.width, half.height) == (320, 240)
    # The same ray meets the same place in the image, counted in halves of a pixel.
    assert (2 * half.fx, 2 * half.cx, 2 * half.cy) == (camera.fx, camera.cx, camera.cy)


def test_unprojected_pixels_lie_where_they_are_seen() -> None:
    camera = make_camera()
    points = np.random.default_rng(0).normal(0, 0.3, (20, 3))
    pose = camera.world_from_camera
    x, y, depths_m = ((points - pose[:3, 3]) @ pose[:3, :3]).T
    places = np.column_stack(
        [camera.fx * x / depths_m + camera.cx, camera.fy * y / depths_m + camera.cy]
    )
    np.testing.assert_allclose(unproject(camera, places, depths_m), points, atol=1e-12)


def test_a_new_viewpoint_is_away_from_all_before_or_turned() -> None:
    def at(x: float, turn_deg: float = 0.0) -> gslts.Camera:
        turn = np.deg2rad(turn_deg)
        return make_camera(
            world_from_camera=gslts.look_at((x, 0, 1), (x + np.cos(turn), np.sin(turn), 1))
        )

    assert new_viewpoints([], [at(0), at(0.3), at(0.5), at(0.6)]) == [True, False, True, False]
    assert new_viewpoints([at(0)], [at(0, 19), at(0, 21), at(0, 40)]) == [False, True, False]
    near = (0.25, np.deg2rad(15))
    assert new_viewpoints([at(0)], [at(0.2), at(0.3), at(0.1, 16)], *near) == [False, True, True]
