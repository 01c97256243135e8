"""Command `gslts eval`."""

import json
from pathlib import Path

import numpy as np
import pytest
import scenes
import sim_scenes
from command import gslts as run
from lpips_files import dim_map, frames_of, write_nerfstudio, write_weights

from gslts.datasets import open_dataset
from gslts.store.map_folder import write_map_folder
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.robot_body import Viewpoint


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return write_weights(tmp_path_factory.mktemp("weights"))


def test_eval_command(weights: tuple[Path, Path], tmp_path: Path) -> None:
    gaussian_map = dim_map()
    write_map_folder(tmp_path / "map", gaussian_map, {}, {})
    write_nerfstudio(tmp_path / "set", frames_of(gaussian_map, 1.0))
    arguments = ("set", "--every", "1")
    done = run("eval", "map", *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "no LPIPS: it needs weights, --lpips-backbone and --lpips-heads" in done.stdout
    done = run("eval", "map@1", *arguments, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["lpips"] is None
    assert result["given"]["psnr_db"] > 40
    assert result["gaussians"] == 200
    assert result["bytes"] == gaussian_map.nbytes
    assert result["bytes_per_gaussian"] == pytest.approx(result["bytes"] / 200)
    assert result["render_ms"] > 0
    files = ("--lpips-backbone", weights[0], "--lpips-heads", weights[1])
    done = run("eval", "map", *arguments, "--json", *files, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert 0 < json.loads(done.stdout)["lpips"] < 0.1
    done = run("eval", "map", *arguments, *files[:2], cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr == "gslts: LPIPS needs both --lpips-backbone and --lpips-heads\n"
    done = run("eval", "map", *arguments, *files[:3], weights[0], cwd=tmp_path)
    assert done.returncode == 1
    assert "alexnet.pth: there is no tensor lin0.model.1.weight" in done.stderr


def test_eval_skips_bad_frames_and_reports_them(tmp_path: Path) -> None:
    robot = Controller(sim_scenes.simple_home(), width=64, height=48, noise="none")
    viewpoints = [Viewpoint(1.0, 1.0, yaw, 20.0) for yaw in np.arange(0.0, 360.0, 20.0)]
    capture(robot, viewpoints, tmp_path / "set")
    frames = open_dataset(tmp_path / "set").frames
    gaussian_map = scenes.random_map(100, dtype=np.float32)
    cameras = {frame.name: frame.camera for k, frame in enumerate(frames) if k % 8}
    write_map_folder(tmp_path / "map", gaussian_map, {}, cameras)
    torn = frames[8].rgb
    torn.write_bytes(torn.read_bytes()[:200])
    done = run("eval", "map", "set", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["given"]["frames"] == 2
    (reason,) = result["skipped"]
    assert reason.startswith(f"{frames[8].name}: set/")
    assert done.stderr == f"skipped {reason}\n"
    done = run("eval", "map", "set", "--every", "5", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("4 frames, poses given")
