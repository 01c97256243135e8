"""Scores of updated maps at test viewpoints."""

from dataclasses import replace

import change_room
import numpy as np
import pytest
import update_room

from gslts.core.camera import Camera, at_pose
from gslts_bench.update.score import AROUND_PX, EvaluationView, Judge, evaluation_view
from gslts_sim.task import Box, Change

RED: Box = ((2.08, 1.73, 0.75), (2.32, 1.97, 1.05))
REMOVAL = Change(
    kind="removal", object_id="Box|1", object_type="Box", box_before=RED, box_after=None
)


def view(shift_m: float = 0.0, *, near: bool = True) -> EvaluationView:
    """Return a viewpoint of the unchanged room with a shifted camera."""
    gaussian_map, _ = change_room.mapped()
    frame = update_room.robot_in(change_room.home()).observe()
    pose = frame.camera.world_from_camera
    pose[0, 3] += shift_m
    frame = replace(frame, camera=at_pose(frame.camera, pose))
    judged = evaluation_view(frame, REMOVAL, gaussian_map, near=near)
    assert judged is not None
    return judged


def middle_px(camera: Camera) -> np.ndarray:
    pose = camera.world_from_camera
    x, y, z = (np.mean(RED, axis=0) - pose[:3, 3]) @ pose[:3, :3]
    return np.array([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy])


def test_crops_are_the_boxes_and_fifty_pixels_around() -> None:
    judged = view()
    ((x0, y0, x1, y1),) = judged.crops
    u, v = middle_px(judged.true_camera)
    assert x0 <= max(0, u - AROUND_PX)
    assert x1 >= min(judged.true_camera.width, u + AROUND_PX)
    assert y0 <= max(0, v - AROUND_PX)
    assert y1 >= min(judged.true_camera.height, v + AROUND_PX)
    assert judged.inside.sum() == (x1 - x0) * (y1 - y0)
    assert judged.inside[y0, x0]


def test_a_view_beside_the_change_is_none() -> None:
    gaussian_map, _ = change_room.mapped()
    robot = update_room.robot_in(change_room.home())
    robot.step("RotateLeft", degrees=180.0)
    assert evaluation_view(robot.observe(), REMOVAL, gaussian_map, near=True) is None


def test_cameras_are_where_the_map_says() -> None:
    at_truth, shifted = view(), view(0.02)
    eyes = [each.camera.world_from_camera[:3, 3] for each in (at_truth, shifted)]
    assert np.linalg.norm(eyes[0] - eyes[1]) < 0.006
    judge = Judge([shifted, view(0.02, near=False)])
    gaussian_map, _ = change_room.mapped()
    score = judge.scores(gaussian_map)["near"]
    assert score.psnr_db > score.true_pose_db + 1


def test_scores_are_best_for_the_image_itself() -> None:
    gaussian_map, _ = change_room.mapped()
    judge = Judge([view(), view(near=False)])
    good = judge.scores(gaussian_map)["near"]
    sh = gaussian_map.sh + np.random.default_rng(0).normal(0, 0.5, gaussian_map.sh.shape)
    bad = judge.scores(replace(gaussian_map, sh=sh.astype(np.float32)))["near"]
    assert good.psnr_db > bad.psnr_db + 3
    assert good.ssim > bad.ssim
    assert good.flip < bad.flip
    assert good.lpips is None
    shown = judge.render(gaussian_map, judge.views[0], judge.views[0].camera)
    perfect = Judge([replace(view, photo=shown) for view in judge.views]).scores(gaussian_map)[
        "near"
    ]
    assert perfect.psnr_db == pytest.approx(100)
    assert perfect.ssim == pytest.approx(1, abs=1e-5)
    assert perfect.flip == pytest.approx(0, abs=1e-5)
    assert judge.psnrs_db(gaussian_map)["near"] == pytest.approx(good.psnr_db)


def test_changes_beside_the_crops_count_outside() -> None:
    gaussian_map, _ = change_room.mapped()
    judge = Judge([view(), view(near=False)])
    before = judge.scores(gaussian_map)["near"]
    far = gaussian_map.means[:, 1] > 3.5  # The wall at the back.
    sh = gaussian_map.sh + far[:, None, None].astype(np.float32)
    after = judge.scores(replace(gaussian_map, sh=sh))["near"]
    assert after.outside_db < before.outside_db - 1
