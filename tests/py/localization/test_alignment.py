"""Direct image alignment: its equations hold for the true change and lead to it."""

import numpy as np
import pytest
from analytic_room import observe

import gslts.mapping.lenses as mapping_lenses
from gslts import Camera, look_at, render
from gslts.core.camera import at_pose
from gslts.core.se3 import fit_rigid_motion, se3_retract, twist_of
from gslts.localization.alignment import NormalEquations, align
from gslts.mapping.gauge import move_map
from gslts.mapping.lenses import Lenses, after_step, pose_step, refine_lenses
from gslts.rendering.losses import Exposure
from gslts_bench.synthetic_rooms import make_room

EYES = [(1.0, 0.8, 1.4), (0.6, 1.5, 1.2), (1.5, 0.4, 1.6), (0.3, 0.5, 1.0), (1.2, 1.3, 0.9)]
TARGETS = [(3.0, 2.0, 0.6), (2.0, 3.0, 0.4), (2.5, 3.0, 0.0), (3.0, 3.0, 0.8), (3.0, 1.0, 1.0)]


def camera_at(pose: np.ndarray, **changes: float) -> Camera:
    numbers = {"fx": 150.0, "fy": 152.0, "cx": 83.0, "cy": 58.0} | changes
    return Camera(**numbers, width=160, height=120, world_from_camera=pose)


def move(camera: Camera, twist: np.ndarray) -> Camera:
    return at_pose(camera, se3_retract(camera.world_from_camera, twist))


def start() -> Camera:
    return camera_at(look_at(EYES[0], TARGETS[0]))


def changed(camera: Camera, change: np.ndarray) -> Camera:
    """Change a camera by (rho, phi, log fx, log fy, cx, cy)."""
    return camera_at(
        move(camera, change[:6]).world_from_camera,
        fx=camera.fx * np.exp(change[6]),
        fy=camera.fy * np.exp(change[7]),
        cx=camera.cx + change[8],
        cy=camera.cy + change[9],
    )


def solved(equations: NormalEquations) -> np.ndarray:
    return np.linalg.solve(equations.hessian[:6, :6], equations.right[:6])


@pytest.mark.parametrize("parameter", range(10))
def test_the_equations_hold_for_a_small_change(parameter: int) -> None:
    """Observe with the changed camera and render with the original one."""
    change = np.zeros(10)
    change[parameter] = 0.05 if parameter >= 8 else 3e-4
    rendered, seen = observe(start()), observe(changed(start(), change))
    alignment = align(start(), *rendered, *seen)
    for equations in (alignment.color, alignment.depth)[: 2 if parameter < 6 else 1]:
        expected = equations.hessian @ change
        error = np.abs(equations.right - expected).max() / np.abs(expected).max()
        assert error < 0.05
    assert not alignment.depth.hessian[6:].any()
    assert not alignment.depth.right[6:].any()


@pytest.mark.parametrize("kind", ["color", "depth"])
def test_steps_lead_to_the_true_pose(kind: str) -> None:
    twist = np.array([0.01, -0.015, 0.012, 0.008, -0.01, 0.012])
    true = move(start(), twist)
    seen, camera = observe(true), start()
    for _ in range(8):
        alignment = align(camera, *observe(camera), *seen)
        camera = move(camera, solved(getattr(alignment, kind)))
    left = np.linalg.inv(camera.world_from_camera) @ true.world_from_camera
    assert np.abs(twist_of(left)).max() < 2e-4


def test_exposure_is_applied_to_the_rendering() -> None:
    rgb, depth = observe(start())
    exposure = Exposure(gain=(0.8, 0.9, 1.1), offset=(0.05, 0.0, -0.02))
    photo = rgb * exposure.gain + exposure.offset
    assert np.abs(align(start(), rgb, depth, photo, depth).color.right).max() > 1
    equal = align(start(), rgb, depth, photo, depth, exposure=exposure)
    assert np.abs(equal.color.right).max() < 1e-6


def test_outliers_edges_holes_and_masked_pixels_do_not_count() -> None:
    rgb, depth = observe(start())
    photo, measured = rgb.copy(), 1.01 * depth
    mask = np.zeros(depth.shape, bool)
    mask[20:100, 20:140] = True
    expected = align(start(), rgb, depth, photo, measured, mask=mask)
    photo[~mask] += 0.1
    measured[~mask] = 0.99 * depth[~mask]
    np.testing.assert_array_equal(
        align(start(), rgb, depth, photo, measured, mask=mask).depth.right, expected.depth.right
    )
    photo, measured = rgb.copy(), depth.copy()
    photo[30:50, 30:50] += 0.5
    measured[30:50, 30:50] *= 1.2
    measured[60:70, 60:70] = 0
    alignment = align(start(), rgb, depth, photo, measured)
    assert np.abs(alignment.color.right).max() < 1e-9
    assert np.abs(alignment.depth.right).max() < 1e-9
    box, moved_box = depth.copy(), depth.copy()
    box[40:80, 40:80] *= 0.9  # Before the wall: where its rim is another, nothing is to be learned.
    moved_box[40:80, 42:82] *= 0.9
    rim = align(start(), rgb, box, rgb, moved_box).depth
    assert np.abs(rim.right).max() < 1e-9
    assert rim.hessian[0, 0] > 0


def test_results_do_not_depend_on_the_number_of_threads() -> None:
    rendered = [image.astype(np.float32) for image in observe(start())]
    seen = [image.astype(np.float32) for image in observe(move(start(), np.full(6, 0.01)))]
    single, three = (align(start(), *rendered, *seen, threads=threads) for threads in (1, 3))
    exact = align(start(), *observe(start()), *observe(move(start(), np.full(6, 0.01))))
    for kind in ("color", "depth"):
        first, second = getattr(single, kind), getattr(three, kind)
        assert first.hessian.tobytes() == second.hessian.tobytes()
        assert first.right.tobytes() == second.right.tobytes()
        np.testing.assert_allclose(first.right, getattr(exact, kind).right, rtol=2e-2, atol=0.5)


def test_images_that_do_not_fit_are_rejected() -> None:
    rgb, depth = observe(start())
    with pytest.raises(
        ValueError, match=r"measured: expected .* \(120, 160\), got .* \(119, 160\)"
    ):
        align(start(), rgb, depth, rgb, depth[1:])
    with pytest.raises(ValueError, match=r"photo: expected .* float64"):
        align(start(), rgb, depth, rgb.astype(np.float32), depth)


def test_intrinsics_are_found_although_all_poses_are_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    """Colour determines the focal length, colour and depth the pose between both cameras."""
    monkeypatch.setattr(mapping_lenses, "CORRELATED_PIXELS", 0.01)  # Nothing is known before.
    rng = np.random.default_rng(0)
    true_color = camera_at(np.eye(4))
    true_depth = move(camera_at(np.eye(4)), np.array([0.03, 0.005, -0.01, 0.01, -0.015, 0.008]))
    beside = move(camera_at(np.eye(4)), np.array([0.01, 0, 0, 0, 0, 0]))
    given = Lenses(camera_at(np.eye(4), fx=154.0, fy=149.0, cx=84.0), beside)
    poses = [look_at(eye, target) for eye, target in zip(EYES, TARGETS, strict=True)]
    photos = [observe(at_pose(true_color, pose))[0] for pose in poses]
    guesses = [
        move(at_pose(true_color, pose), rng.normal(0, 0.01, 6)).world_from_camera for pose in poses
    ]
    lenses = given
    for _ in range(15):
        steps = []
        for k, pose in enumerate(poses):
            camera = at_pose(lenses.color, guesses[k])
            # What the depth lens measured, taken to be where `lenses` says, seen by that camera.
            error = (
                pose
                @ true_depth.world_from_camera
                @ np.linalg.inv(camera.world_from_camera @ lenses.depth.world_from_camera)
            )
            measured = observe(at_pose(camera, error @ camera.world_from_camera))[1]
            alignment = align(camera, *observe(camera), photos[k], measured)
            twist = pose_step(alignment)
            guesses[k] = move(camera, twist).world_from_camera
            steps.append(after_step(alignment, twist))
        lenses = refine_lenses(lenses, given, steps)
    assert lenses.color.fx == pytest.approx(150.0, abs=0.05)
    assert lenses.color.fy == pytest.approx(152.0, abs=0.05)
    assert lenses.color.cx == pytest.approx(83.0, abs=0.05)
    left = np.linalg.inv(lenses.depth.world_from_camera) @ true_depth.world_from_camera
    assert np.abs(twist_of(left)[:3]).max() < 5e-4
    assert np.abs(twist_of(left)[3:]).max() < 5e-4
    assert (lenses.depth.fx, lenses.depth.cx) == (150.0, 83.0)


def test_the_world_comes_back_from_a_motion() -> None:
    rng = np.random.default_rng(1)
    given = np.array([look_at(eye, target) for eye, target in zip(EYES, TARGETS, strict=True)])
    motion = move(camera_at(np.eye(4)), np.array([0.1, -0.2, 0.05, 0.02, -0.01, 0.03]))
    found = fit_rigid_motion(motion.world_from_camera @ given, given, 2.0)
    np.testing.assert_allclose(found @ motion.world_from_camera, np.eye(4), atol=1e-12)
    jittered = [move(camera_at(pose), rng.normal(0, 0.001, 6)).world_from_camera for pose in given]
    near = fit_rigid_motion(np.array(jittered), given, 2.0)
    assert np.abs(near - np.eye(4)).max() < 0.003
    assert np.linalg.det(near[:3, :3]) == pytest.approx(1)


def test_turned_cameras_turn_the_world_by_how_far_away_they_see() -> None:
    given = np.array([look_at(eye, target) for eye, target in zip(EYES, TARGETS, strict=True)])
    turned, by_rad = given.copy(), 0.02
    turned[:, :3, :3] = (
        move(camera_at(np.eye(4)), np.array([0, 0, 0, 0, 0, by_rad])).world_from_camera[:3, :3]
        @ given[:, :3, :3]
    )
    left = []
    for arm_m in (0.1, 1.0, 10.0):
        back = fit_rigid_motion(turned, given, arm_m)
        left.append(by_rad + twist_of(back)[5])
    assert left[0] > 0.9 * by_rad  # Where the cameras stand decides.
    assert left[2] < 0.1 * by_rad  # What they see does.
    assert left[0] > left[1] > left[2]


def test_a_moved_map_is_rendered_alike_by_a_moved_camera() -> None:
    room = make_room("S")
    twist = np.array([0.05, -0.02, 0.03, 0.004, -0.003, 0.005])
    motion = move(at_pose(room.camera, np.eye(4)), twist).world_from_camera
    before = render(room.gaussian_map, room.camera).rgb
    camera = at_pose(room.camera, motion @ room.camera.world_from_camera)
    after = render(move_map(room.gaussian_map, motion), camera).rgb
    assert np.abs(after - before).mean() < 5e-4
    assert np.abs(render(room.gaussian_map, camera).rgb - before).mean() > 1e-2
