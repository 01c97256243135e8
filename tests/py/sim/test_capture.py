"""Tests of recordings: content, geometry, and the state after a failure."""

import errno
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sim_scenes
from PIL import Image

import gslts
from gslts.datasets.poses import OPENGL_FROM_OPENCV
from gslts.types import Floats32
from gslts_sim import make_home
from gslts_sim.capture import capture, true_poses
from gslts_sim.controller import Controller
from gslts_sim.explore import COMPLETE_FRACTION, explore
from gslts_sim.home import Home
from gslts_sim.ray_scene import Hits, RayScene
from gslts_sim.robot_body import Viewpoint

VIEWPOINTS = [Viewpoint(1.0, y, yaw, 30.0) for y, yaw in ((1.0, 0.0), (1.0, 45.0), (2.5, 330.0))]


def robot(noise: str = "none") -> Controller:
    return Controller(sim_scenes.furnished_home(), width=96, height=72, noise=noise)


def read(folder: Path) -> tuple[dict, list[dict[str, np.ndarray]]]:
    """Read a data set without the project's loader, and check that it is complete."""
    header = json.loads((folder / "transforms.json").read_text())
    frames = []
    for frame in header["frames"]:
        images = {
            key: np.asarray(Image.open(folder / frame[key]))
            for key in ("file_path", "depth_file_path", "instance_file_path")
        }
        assert all(p.shape[:2] == (header["h"], header["w"]) for p in images.values())
        pose = np.array(frame["transform_matrix"]) @ OPENGL_FROM_OPENCV
        frames.append({**images, "world_from_camera": pose})
    return header, frames


def points_in_world(header: dict, frame: dict[str, np.ndarray]) -> np.ndarray:
    depth = frame["depth_file_path"] * header["depth_unit_scale_factor"]
    rows, columns = np.indices(depth.shape) + 0.5
    x = (columns - header["cx"]) / header["fl_x"] * depth
    y = (rows - header["cy"]) / header["fl_y"] * depth
    pose = frame["world_from_camera"]
    return np.stack([x, y, depth], axis=-1) @ pose[:3, :3].T + pose[:3, 3]


def test_points_of_all_frames_lie_on_the_objects(tmp_path: Path) -> None:
    assert capture(robot(), VIEWPOINTS, tmp_path / "set") == len(VIEWPOINTS)
    header, frames = read(tmp_path / "set")
    objects = json.loads((tmp_path / "set" / "objects.json").read_text())
    assert header["camera_model"] == "OPENCV"
    assert len(frames) == len(VIEWPOINTS)
    seen = set()
    for frame in frames:
        assert frame["file_path"].dtype == np.uint8
        assert frame["depth_file_path"].dtype == np.uint16
        points = points_in_world(header, frame)
        for number in np.unique(frame["instance_file_path"]):
            obj = objects[number - 1]
            seen.add(obj["objectId"])
            box = obj["axisAlignedBoundingBox"]
            middle, size = (np.array([box[k][a] for a in "xyz"]) for k in ("center", "size"))
            of_thing = points[frame["instance_file_path"] == number]
            # Half a millimetre of rounding, and no more.
            assert (np.abs(of_thing - middle) <= size / 2 + 0.0015).all(), obj["objectId"]
    assert seen >= {"Wall|1", "Block|1", "Mug|1", "Mug|2"}


def test_points_of_one_frame_are_rendered_where_the_next_one_sees_them(tmp_path: Path) -> None:
    """The rasterizer, poses and depths read back agree within half a pixel."""
    capture(robot(), VIEWPOINTS, tmp_path / "set")
    header, frames = read(tmp_path / "set")
    camera = gslts.Camera(
        fx=header["fl_x"],
        fy=header["fl_y"],
        cx=header["cx"],
        cy=header["cy"],
        width=header["w"],
        height=header["h"],
        world_from_camera=frames[1]["world_from_camera"],
    )
    there = points_in_world(header, frames[1])
    rows, columns = np.indices(there.shape[:2]) + 0.5
    checked = 0
    for point in points_in_world(header, frames[0])[5::9, 40::7].reshape(-1, 3):
        dot = gslts.GaussianMap(
            means=point[None],
            quats=np.array([[1.0, 0, 0, 0]]),
            log_scales=np.full((1, 3), np.log(0.01)),
            logit_opacities=np.full(1, 3.0),
            sh=np.zeros((1, 1, 3)),
        ).astype(np.float32)
        images = gslts.render(dot, camera, gslts.RenderOptions(surface_depth=False))
        if images.alpha.sum() < 0.5:
            continue  # Not in that view.
        u, v = ((images.alpha * at).sum() / images.alpha.sum() for at in (columns, rows))
        seen = there[int(v), int(u)]
        depth = images.depth[int(v), int(u)]
        if not 1 < u < 95 or not 1 < v < 71 or np.linalg.norm(seen - point) > 0.3:
            continue  # At the border, or hidden by something.
        checked += 1
        # The middle of the pixel is up to 0.71 px from the dot; more is an error.
        assert np.linalg.norm(seen - point) < (0.71 + 0.5) * depth / camera.fx * 3
        camera_from_world = np.linalg.inv(camera.world_from_camera)
        x, y, z = camera_from_world[:3, :3] @ point + camera_from_world[:3, 3]
        assert abs(camera.fx * x / z + camera.cx - u) < 0.5
        assert abs(camera.fy * y / z + camera.cy - v) < 0.5
        assert abs(z - depth) < 1e-3
    assert checked >= 10


def test_the_recorded_pose_is_the_believed_one(tmp_path: Path) -> None:
    capture(robot("kinect"), VIEWPOINTS[:2], tmp_path / "noisy")
    capture(robot("none"), VIEWPOINTS[:2], tmp_path / "true")
    (_, noisy), (_, true) = read(tmp_path / "noisy"), read(tmp_path / "true")
    shift = noisy[0]["world_from_camera"][:3, 3] - true[0]["world_from_camera"][:3, 3]
    assert 0 < np.linalg.norm(shift) < 0.05
    lost = [(frame["depth_file_path"] == 0).mean() for frame in (noisy[0], true[0])]
    assert lost[0] > lost[1] == 0


def test_true_poses_are_those_of_the_robot(tmp_path: Path) -> None:
    capture(robot("kinect"), VIEWPOINTS[:2], tmp_path / "visit")
    capture(robot("none"), VIEWPOINTS[:2], tmp_path / "true")
    poses = true_poses(tmp_path / "visit")
    assert list(poses) == ["00000", "00001"]
    _, frames = read(tmp_path / "true")
    for frame, pose in zip(frames, poses.values(), strict=True):
        np.testing.assert_allclose(pose, frame["world_from_camera"], atol=1e-12)
    path = tmp_path / "visit" / "transforms.json"
    path.write_text('{"frames": [{"file_path": "images/00000.png"}]}')
    with pytest.raises(ValueError, match=r"transforms\.json: it has no true poses"):
        true_poses(tmp_path / "visit")


def full_after(monkeypatch: pytest.MonkeyPatch, images: int) -> None:
    """Simulate a disk with room for a number of images, which fills during the next."""
    write = Path.write_bytes
    left = [images]

    def limited(self: Path, content: bytes) -> None:
        if left[0] == 0:
            write(self, content[: len(content) // 2])
            raise OSError(errno.ENOSPC, "No space left on device")
        left[0] -= 1
        write(self, content)

    monkeypatch.setattr(Path, "write_bytes", limited)


@pytest.mark.parametrize("images", [0, 1, 4, 5, 6])
def test_a_full_disk_leaves_complete_frames(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, images: int
) -> None:
    full_after(monkeypatch, images)
    whole = images // 3
    folder = tmp_path / "set"
    with pytest.raises(
        OSError, match=rf"set: No space left on device; {whole} complete frames"
    ) as e:
        capture(robot(), VIEWPOINTS, folder)
    assert "\n" not in str(e.value)
    left = sorted(path.name for path in folder.glob("*/*.png"))
    assert len(left) == 3 * whole
    if whole:
        assert len(read(folder)[1]) == whole
    else:
        assert not (folder / "transforms.json").exists()


def test_frames_are_dropped_until_their_list_fits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The list of frames fits only after a frame is removed."""
    from gslts.datasets import recording as module

    full_after(monkeypatch, 6)
    write, rejections = module.write_atomic, [1]

    def failing_write(path: Path, content: bytes) -> None:
        if path.name == "transforms.json" and rejections[0]:
            rejections[0] -= 1
            raise OSError(errno.ENOSPC, "No space left on device")
        write(path, content)

    monkeypatch.setattr(module, "write_atomic", failing_write)
    with pytest.raises(OSError, match="1 complete frames are kept"):
        capture(robot(), VIEWPOINTS, tmp_path / "set")
    assert len(read(tmp_path / "set")[1]) == 1
    assert len(list((tmp_path / "set").glob("*/*.png"))) == 3


def test_an_interruption_leaves_complete_frames(tmp_path: Path) -> None:
    def interrupted():
        yield from VIEWPOINTS[:2]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        capture(robot(), interrupted(), tmp_path / "set")
    assert len(read(tmp_path / "set")[1]) == 2


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("data")
    with pytest.raises(ValueError, match="is not empty"):
        capture(robot(), VIEWPOINTS, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["precious"]


def test_a_blocked_viewpoint_is_named(tmp_path: Path) -> None:
    blocked = Viewpoint(2.5, 1.9, 0.0, 0.0)
    with pytest.raises(ValueError, match=r"capture: Teleport: the robot cannot stand at \(2\.5"):
        capture(robot(), [*VIEWPOINTS[:1], blocked], tmp_path / "set")
    assert len(read(tmp_path / "set")[1]) == 1


@pytest.fixture(scope="module")
def bedroom() -> Home:
    return make_home("bedroom", 5, detail=0.05)


def test_exploring_ends_when_all_is_seen(bedroom: Home) -> None:
    viewpoints, share = explore(bedroom, 1000)
    assert COMPLETE_FRACTION <= share <= 1
    assert 30 < len(viewpoints) < 500
    few, less = explore(bedroom, 20)
    assert len(few) == 20
    assert 0.2 < less < share
    poses = {
        (viewpoint.x, viewpoint.y, viewpoint.yaw_deg, viewpoint.horizon_deg)
        for viewpoint in viewpoints
    }
    assert len(poses) == len(viewpoints)


def test_rounding_of_distances_does_not_change_the_views(monkeypatch: pytest.MonkeyPatch) -> None:
    """The walls lie on boundaries of cells; views of both of their layers would cover less."""
    home = sim_scenes.furnished_home()
    expected, share = explore(home, 24)
    cast = RayScene.cast
    rng = np.random.default_rng(0)

    def rounded(scene: RayScene, rays: Floats32) -> Hits:
        hits = cast(scene, rays)
        error = 1e-6 * rng.uniform(-1, 1, hits.distances.shape).astype(np.float32)
        return replace(hits, distances=hits.distances * (1 + error))

    monkeypatch.setattr(RayScene, "cast", rounded)
    viewpoints, of_rounded = explore(home, 24)
    assert of_rounded == pytest.approx(share, abs=0.01)
    same = sum(viewpoint in expected for viewpoint in viewpoints)
    assert same >= 20


def test_few_views_see_most_objects(bedroom: Home) -> None:
    """The first views cover more than random views."""
    robot = Controller(bedroom, width=64, height=48)
    seen: set[str] = set()
    for viewpoint in explore(bedroom, 40)[0]:
        x, y = viewpoint.x, viewpoint.y
        event = robot.step(
            "Teleport",
            position={"x": x, "y": y},
            rotation=viewpoint.yaw_deg,
            horizon=viewpoint.horizon_deg,
        )
        assert event.metadata["lastActionSuccess"]
        seen |= set(event.instance_masks)
    movable = {obj.id for obj in bedroom.objects if obj.movable}
    assert len(seen & movable) >= 0.8 * len(movable)
