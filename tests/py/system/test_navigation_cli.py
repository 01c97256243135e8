"""Commands `gslts semantic-map` and `gslts go`, in a small room."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import surfel_room
import yaml
from command import gslts
from PIL import Image

from gslts import Navigator, SemanticQueries
from gslts.cli import app
from gslts.core.camera import Camera, camera_from_fov, look_at
from gslts.datasets import open_dataset
from gslts.keeper.state import read_state
from gslts.robots.in_map import MapRobot
from gslts.store.map_folder import open_map, write_map_folder
from gslts_sim import write_glb
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.explore import explore


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a home, and a map of it with semantic features."""
    folder = tmp_path_factory.mktemp("navigation")
    home = surfel_room.home()
    write_glb(home, folder / "home.glb")
    write_glb(home.without(["Mug|1"]), folder / "without.glb")
    viewpoints, _ = explore(home, 16)
    capture(Controller(home, width=160, height=120), viewpoints, folder / "visit")
    cameras = {frame.name: frame.read().camera for frame in open_dataset(folder / "visit").frames}
    room = surfel_room.surfel_map()
    plain = replace(room, features=np.zeros((room.size, 0), np.float32))
    write_map_folder(folder / "plain", plain, {}, cameras)
    write_map_folder(folder / "map", plain, {}, cameras)
    add = ["semantics", str(folder / "map"), str(folder / "visit"), "--code-dims", "8"]
    app(add, standalone_mode=False)
    return folder


@pytest.mark.smoke
def test_a_semantic_map_is_written(folder: Path) -> None:
    layers = ("--category", "Mug", "--category", "Sofa")
    done = gslts("semantic-map", "map", *layers, "--out", "plan", cwd=folder)
    assert done.returncode == 0, done.stderr
    header = yaml.safe_load((folder / "plan" / "map.yaml").read_text())
    image = np.asarray(Image.open(folder / "plan" / header["image"]))
    size = len(image)
    assert done.stdout == f"wrote {size} x {size} cells of 0.05 m to plan; not found: Sofa\n"
    assert set(np.unique(image)) == {0, 205, 254}
    assert abs((image == 254).sum() * 0.05**2 - (4 * 3 - 0.8 * 1.2 - 0.4 * 0.4)) < 1
    plan = np.asarray(Image.open(folder / "plan" / "map.png")).astype(int)
    assert (np.ptp(plan, axis=2) > 100).any()


def test_a_map_without_semantics_has_no_categories(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    app(["semantic-map", "plain", "--out", "obstacles"], standalone_mode=False)
    assert (folder / "obstacles" / "map.pgm").exists()
    for arguments in (
        ("semantic-map", "plain", "--category", "Mug", "--out", "none"),
        ("go", "plain", "Mug", "--robot", "home.glb"),
    ):
        with pytest.raises(ValueError, match="has no semantic features; gslts semantics adds"):
            app(arguments, standalone_mode=False)
    assert not (folder / "none").exists()


@pytest.mark.smoke
def test_a_robot_navigates_to_an_object(folder: Path) -> None:
    done = gslts("go", "map", "mug", "--robot", "home.glb", "--out", "path.png", cwd=folder)
    assert done.returncode == 0, done.stderr
    words = done.stdout.split()
    assert words[:3] == ["reached", "the", "mug:"]
    assert float(done.stdout.partition("ends ")[2].split()[0]) <= 1
    assert done.stdout.endswith("; see path.png\n")
    assert np.asarray(Image.open(folder / "path.png")).shape[1] > 300
    done = gslts("go", "map", "sofa", "--robot", "home.glb", cwd=folder)
    assert done.returncode == 1
    assert done.stderr == "gslts: sofa: not found: the map has no sofa; see go.png\n"


def test_queries_and_navigators_read_map_folders(folder: Path) -> None:
    (mug,) = SemanticQueries.of_map(folder / "map").find("mug")
    np.testing.assert_allclose(mug.center, (2.275, 1.475, 0.825), atol=0.1)
    navigator = Navigator.of_map(folder / "map", categories=["Mug"])
    assert navigator.semantic_map.category("Mug").any()
    for of_map in (SemanticQueries.of_map, Navigator.of_map):
        with pytest.raises(ValueError, match="has no semantic features; gslts semantics adds"):
            of_map(folder / "plain")


def test_without_a_robot_navigation_is_tried_in_the_map(folder: Path) -> None:
    done = gslts("go", "map", "mug", "--out", "tried.png", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.partition("ends ")[2].split()[0]) <= 1
    assert (folder / "tried.png").exists()
    done = gslts("go", "map", "mug", "--watch", cwd=folder)
    assert done.stderr == "gslts: --watch needs a --robot: in the map, nothing changes\n"


def test_a_robot_in_the_map_starts_on_free_floor(folder: Path) -> None:
    """Recorded by hand, the first camera may be above a table, or off the map."""
    navigator = Navigator.of_map(folder / "map", categories=["Mug"])
    robot = MapRobot(navigator.gaussian_map, navigator.semantic_map, navigator.body, far_camera())
    position = robot.pose()[:2, 3]
    offsets_m = np.linalg.norm(robot.reachable_positions() - position, axis=1)
    assert offsets_m.min() == 0
    nearest_m = np.linalg.norm(robot.reachable_positions() - FAR[:2], axis=1).min()
    assert np.linalg.norm(position - FAR[:2]) == pytest.approx(nearest_m)
    assert robot.pose()[2, 3] == FAR[2]


FAR = np.array([-3.0, 9.0, 1.1])


def far_camera() -> Camera:
    return camera_from_fov(160, 120, 1.5, look_at(FAR, FAR + np.array([1, -1, -0.2])))


def test_a_robot_detects_changes_on_its_way(folder: Path) -> None:
    done = gslts("go", "map", "mug", "--robot", "home.glb", "--watch", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "reached the mug: " in done.stdout
    assert read_state(folder / "map").round == 0
    with open_map(folder / "map", writable=True):  # A second writer is rejected.
        done = gslts("go", "map", "mug", "--robot", "home.glb", "--watch", cwd=folder)
    assert done.stderr == "gslts: map: another process writes this map; wait until it ends\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("mug", "--robot", "without.glb"), "mug: not found: no mug is where the map has one"),
        ((" ", "--robot", "home.glb"), "TEXT: expected the name of an object"),
        (("mug", "--robot", "nowhere.glb"), "nowhere.glb"),
        (("mug", "--robot", "bathroom"), "expected one of kitchen"),
        (("mug", "--robot", "visit/transforms.json"), "neither a day nor a scene change task"),
    ],
)
def test_failures_are_reported(
    folder: Path, arguments: tuple[str, ...], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    with pytest.raises((OSError, RuntimeError, ValueError), match=message):
        app(["go", "map", *arguments], standalone_mode=False)
