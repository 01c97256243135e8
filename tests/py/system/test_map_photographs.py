"""`gslts map --poses estimate` of photographs without depth."""

import json
import shutil
from pathlib import Path

import change_room
import numpy as np
import pytest
from command import gslts as run
from PIL import Image

from gslts.core.camera import Camera
from gslts.datasets import open_dataset
from gslts.store.camera_files import cameras_of_map
from gslts_sim import make_home
from gslts_sim.controller import Controller
from gslts_sim.explore import explore

pytest.importorskip("pycolmap")


@pytest.fixture(scope="module")
def photographs(tmp_path_factory) -> tuple[Path, dict[str, np.ndarray]]:
    """Return a folder of photographs, with another file and a damaged one, and the true poses."""
    folder = tmp_path_factory.mktemp("photographs") / "holiday"
    folder.mkdir()
    home = make_home("living_room", 3, detail=0.2)
    robot = Controller(home, width=480, height=360, noise="none")
    poses = {}
    for number, viewpoint in enumerate(explore(home, 60)[0][:20]):
        robot.go(viewpoint)
        frame = robot.observe()
        Image.fromarray(frame.rgb).save(folder / f"{number:02}.png")
        poses[f"{number:02}"] = frame.camera.world_from_camera
    (folder / "notes.txt").write_text("no photograph")
    (folder / "damaged.jpg").write_bytes(b"no image")
    return folder, poses


def test_photographs_become_a_map(photographs, tmp_path):
    folder, true = photographs
    options = ("--poses", "estimate", "--preset", "fast", "--iterations", "50", "--out", "map")
    done = run("map", folder, *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "not placed: damaged.jpg: " in done.stderr
    assert "map.colmap is a data set with their poses" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map", "map.colmap"]
    placed = {f.name: f.camera for f in open_dataset(tmp_path / "map.colmap").frames}
    assert len(placed) > 15
    assert len(cameras_of_map(tmp_path / "map")) > 12
    focal_px = next(iter(placed.values())).fx
    assert focal_px == pytest.approx(240, rel=0.02)
    metres, turns_rad, up = errors_of(placed, true)
    assert np.median(metres) < 0.02
    assert np.median(turns_rad) < np.deg2rad(0.5)
    assert np.arccos(up[2]) < np.deg2rad(2)
    done = run("eval", "map", "map.colmap", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["given"]["frames"] >= 1
    shutil.rmtree(tmp_path / "map")  # As if the run had been stopped before its first checkpoint.
    done = run("map", folder, *options, cwd=tmp_path)
    assert "map.colmap is there already; use it with --resume, or remove it" in done.stderr
    done = run("map", folder, *options, "--jobs", "1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "finding keypoints" not in done.stdout, "the poses were kept"
    assert len(cameras_of_map(tmp_path / "map")) > 12


def test_too_few_photographs_of_one_place(tmp_path):
    few = tmp_path / "few"
    few.mkdir()
    for number in range(4):
        colors = np.random.default_rng(number).integers(0, 255, (240, 320, 3))
        Image.fromarray(colors.astype(np.uint8)).save(few / f"{number}.png")
    done = run("map", few, "--poses", "estimate", "--out", "map", cwd=tmp_path)
    assert done.returncode == 1
    assert "0 of 4 photographs show the same place, 4 are needed" in done.stderr.splitlines()[-1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["few"]


@pytest.mark.parametrize("poses", ["given", "correct"])
def test_photographs_have_no_poses(photographs, poses, tmp_path):
    done = run("map", photographs[0], "--poses", poses, "--out", "map", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.endswith("photographs without poses; --poses estimate finds them\n")


def test_photographs_do_not_extend_a_map(photographs, tmp_path):
    change_room.write_room_map(tmp_path / "map")
    done = run("extend", "map", photographs[0], "--poses", "estimate", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.endswith("holiday: photographs do not tell the scale of the map\n")


def errors_of(
    placed: dict[str, Camera], true: dict[str, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return errors, m and rad, after a similarity, and the true upward axis in the found world."""
    poses = np.array([camera.world_from_camera for camera in placed.values()])
    given = np.array([true[name] for name in placed])
    u, _, v = np.linalg.svd(np.einsum("nij,nkj->ik", given[:, :3, :3], poses[:, :3, :3]))
    turn = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    sizes = [
        np.linalg.norm(np.diff(positions[:, :3, 3], axis=0), axis=1).sum()
        for positions in (given, poses)
    ]
    moved = sizes[0] / sizes[1] * poses[:, :3, 3] @ turn.T
    offsets = moved - given[:, :3, 3]
    metres = np.linalg.norm(offsets - np.median(offsets, axis=0), axis=1)
    traces = np.einsum("nij,nij->n", turn @ poses[:, :3, :3], given[:, :3, :3])
    return metres, np.arccos(np.clip((traces - 1) / 2, -1, 1)), turn.T @ (0, 0, 1)
