"""The command `gslts localize` and the option --localize end to end."""

import json
import re
import shutil
import struct
import zlib
from pathlib import Path

import adrift
import change_room
import numpy as np
import pytest
import update_room
from change_room import SIZE, VIEWPOINTS
from command import gslts
from PIL import Image
from update_room import viewpoints_of_the_change

from gslts.datasets import open_dataset
from gslts.io.ply import write_ply
from gslts.store.map_folder import camera_to_json, read_map
from gslts_sim.capture import capture
from gslts_sim.controller import Controller

PLACE = r"\((-?[\d.]+), (-?[\d.]+), (-?[\d.]+)\) m"
SIZES = r"([\d.]+) mm(?:, \+-| and) ([\d.]+) degrees"
LOST = "lost: too few keypoints of the image match the map"
WELL_M = 0.06
"""Maximum error of a pose of such small images, at half their size, m."""
FAST = ("--halvings", "0", "--threads", "1")


@pytest.fixture(scope="module")
def visited(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a map and visits after the removal of the red box, one with drifting odometry.

    The last frame is black.
    """
    folder = tmp_path_factory.mktemp("localize")
    adrift.write_room_map(folder / "map")
    change_room.write_room_map(folder / "bare")
    write_ply(read_map(folder / "map"), folder / "map.ply")
    home = change_room.home().without(["Box|1"])
    capture(Controller(home, **SIZE), [*VIEWPOINTS, VIEWPOINTS[0]], folder / "visit")
    darken(folder / "visit", "00003")
    adrift.set_adrift(folder / "visit", folder / "adrift")
    lens = camera_to_json(true_cameras(folder)[0])
    for name, content in (
        ("camera.json", lens),
        ("lens.json", {k: v for k, v in lens.items() if k != "world_from_camera"}),
        ("other.json", {**lens, "width": 320}),
        ("none.json", {"fx": 80}),
    ):
        (folder / name).write_text(json.dumps(content))
    (folder / "broken.json").write_text("{")
    (folder / "text.png").write_text("no image")
    Image.fromarray(np.zeros((90, 120, 3), np.uint8)).save(folder / "small.jpg")
    (folder / "vast.png").write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + png_chunk(b"IHDR", struct.pack(">II5B", 20_000, 20_000, 8, 2, 0, 0, 0))
        + png_chunk(b"IDAT", b"")
    )
    return folder


def png_chunk(kind: bytes, content: bytes) -> bytes:
    check = struct.pack(">I", zlib.crc32(kind + content))
    return struct.pack(">I", len(content)) + kind + content + check


def darken(visit: Path, name: str) -> None:
    """Replace a frame of a recording by a black one without depth."""
    for path in (visit / "images" / f"{name}.png", visit / "depth" / f"{name}.png"):
        with Image.open(path) as image:
            black = np.zeros_like(np.asarray(image))
        Image.fromarray(black).save(path)


def true_cameras(visited: Path) -> list:
    return [frame.camera for frame in open_dataset(visited / "visit").frames]


def off_m(camera: object, place: object) -> float:
    return float(np.linalg.norm(camera.world_from_camera[:3, 3] - np.asarray(place, float)))


@pytest.mark.smoke
def test_a_single_image_is_localized(visited: Path) -> None:
    done = gslts("localize", "map", "visit/images/00000.png", "--threads", "1", cwd=visited)
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.splitlines()
    match = re.fullmatch(rf"00000: ok at {PLACE}, \+- {SIZES}, (\d+) keypoints, [\d.]+ s", line)
    assert match
    assert off_m(true_cameras(visited)[0], match.groups()[:3]) < WELL_M
    assert 1 <= float(match[4]) < 50
    assert int(match[6]) >= 12


@pytest.mark.parametrize(
    "lens", [(), ("--camera", "camera.json"), ("--camera", "lens.json"), ("--fov-deg", "90")]
)
def test_json_and_an_image(visited: Path, tmp_path: Path, lens: tuple[str, ...]) -> None:
    out = tmp_path / "images" / "beside.png"
    done = gslts(
        *("localize", "map", "visit/images/00001.png", "--depth", "visit/depth/00001.png"),
        *(*lens, *FAST, "--json", "--out", out),
        cwd=visited,
    )
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert (answer["frame"], answer["status"], answer["reason"]) == ("00001", "ok", "")
    true = true_cameras(visited)[1]
    pose = np.array(answer["world_from_camera"])
    assert off_m(true, pose[:3, 3]) < WELL_M
    assert np.trace(pose[:3, :3].T @ true.world_from_camera[:3, :3]) > 1 + 2 * np.cos(0.02)
    covariance = np.array(answer["covariance"])
    assert covariance.shape == (6, 6)
    assert (np.linalg.eigvalsh(covariance) > 0).all()
    assert answer["inliers"] >= 12
    assert 0 < answer["residual"] < 0.2
    assert answer["others"] == []
    assert answer["error_m"] is answer["error_rad"] is None
    assert done.stderr.splitlines()[-1] == f"see {out}"
    with Image.open(out) as image:
        left, right = np.split(np.asarray(image, float), 2, axis=1)
    with Image.open(visited / "visit" / "images" / "00001.png") as image:
        np.testing.assert_array_equal(left, np.asarray(image))
    assert np.abs(left - right).mean() < 25, "the map looks like it from there"


def test_a_lost_image_is_a_result_not_an_error(visited: Path, tmp_path: Path) -> None:
    out = tmp_path / "beside.png"
    arguments = ("localize", "map", "visit/images/00003.png", "--out", out)
    done = gslts(*arguments, cwd=visited)
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"00003: {LOST}\n"
    assert not out.exists()
    answer = json.loads(gslts(*arguments, "--json", cwd=visited).stdout)
    assert answer["status"] == "lost"
    assert answer["world_from_camera"] is answer["covariance"] is answer["residual"] is None


@pytest.mark.parametrize("track", [(), ("--track",)])
def test_poses_of_a_data_set_are_not_used(visited: Path, track: tuple[str, ...]) -> None:
    done = gslts("localize", "map", "adrift", *track, *FAST, cwd=visited)
    assert done.returncode == 0, done.stderr
    *frames, lost, summary = done.stdout.splitlines()
    assert len(frames) == 3
    given = [frame.camera for frame in open_dataset(visited / "adrift").frames]
    for number, line in enumerate(frames):
        match = re.search(rf"ok at {PLACE}.*; {SIZES} from the given pose", line)
        assert match
        true = true_cameras(visited)[number]
        place = match.groups()[:3]
        assert off_m(true, place) < WELL_M
        assert float(match[4]) / 1000 == pytest.approx(off_m(given[number], place), abs=2e-3)
        assert float(match[5]) == pytest.approx(10, abs=1)
    assert lost.startswith("00003: lost: ")
    assert re.fullmatch(
        rf"3 of 4 frames ok, 0 ambiguous, 1 lost; medians: [\d.]+ s, {SIZES} from the given poses",
        summary,
    )


def test_tracking_starts_at_the_previous_pose(visited: Path, tmp_path: Path) -> None:
    capture(Controller(change_room.home(), **SIZE), [VIEWPOINTS[0]] * 3, tmp_path / "still")
    done = gslts("localize", "map", tmp_path / "still", "--track", *FAST, cwd=visited)
    assert done.returncode == 0, done.stderr
    first, second, third, _ = done.stdout.splitlines()
    assert "keypoints" in first
    assert ", tracked, " in second
    assert ", tracked, " in third


def test_changes_are_detected_despite_drift(visited: Path) -> None:
    detect = ("detect", "map", "adrift", "--halvings", "0", "--threads", "1")
    expected = gslts("detect", "map", "visit", *detect[3:], cwd=visited).stdout.splitlines()
    blind = gslts(*detect, cwd=visited).stdout.splitlines()
    done = gslts(*detect, "--localize", cwd=visited)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    for blind_line, line, same in zip(blind[:3], lines, expected, strict=False):
        assert "unreliable" in blind_line
        found, wanted = (re.search(rf"removal at {PLACE}", text) for text in (line, same))
        np.testing.assert_allclose(
            np.array(found.groups(), float), np.array(wanted.groups(), float), atol=0.05
        )
        assert line.count(";") == same.count(";") == 0
    lost = f"00003: unreliable: {LOST}"
    assert lines[3:] == [lost]


def test_frames_without_poses_are_localized_and_compared(visited: Path, tmp_path: Path) -> None:
    shutil.copytree(visited / "visit", tmp_path / "bare")
    file = tmp_path / "bare" / "transforms.json"
    content = json.loads(file.read_text())
    for frame in content["frames"]:
        del frame["transform_matrix"]
    file.write_text(json.dumps(content))
    rejected = gslts("detect", visited / "map", "bare", *FAST, cwd=tmp_path)
    assert rejected.returncode == 1
    assert "0 usable frames, at least 2 are needed; 4 frames (00000, 00001, " in rejected.stderr
    found = gslts("localize", visited / "map", "bare", *FAST, cwd=tmp_path)
    assert found.returncode == 0, found.stderr
    assert "00001: ok at (" in found.stdout
    assert "from the pose" not in found.stdout
    done = gslts("detect", visited / "map", "bare", "--localize", *FAST, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "removal at (2." in done.stdout.splitlines()[1]


@pytest.mark.parametrize("command", [("run", "--frames", "long"), ("update", "--frames", "long")])
def test_a_recording_with_drift_updates_a_map(visited: Path, command: tuple[str, ...]) -> None:
    if not (visited / "long").exists():
        robot = update_room.robot_in(update_room.changed_home("removal"))
        capture(robot, viewpoints_of_the_change(), visited / "true")
        adrift.set_adrift(visited / "true", visited / "long")
        darken(visited / "long", "00002")
    verb, *rest = command
    adrift.write_room_map(visited / f"map_to_{verb}")
    quick = ("--localize", "--iterations", "20", "--threads", "1")
    done = gslts(verb, f"map_to_{verb}", *rest, *quick, cwd=visited)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("removal at (2.")
    assert "is version 2 now" in done.stdout
    skipped = [line for line in done.stderr.splitlines() if line.startswith("skipped")]
    assert skipped == [f"skipped 00002: {LOST}"]
    new = read_map(visited / f"map_to_{verb}")
    assert update_room.opaque_in(new, update_room.REMOVED, 0.04) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("gone", "visit"), "gone"),
        (("map", "gone.png"), "gone.png"),
        (("map", "gone"), "gone: there is no such file or folder"),
        (("map", "text.png"), "text.png: not an image"),
        (("map", "vast.png", "--fov-deg", "90"), "vast.png: 20000 x 20000 px, at most"),
        (("map", "small.jpg"), "no camera of map has 120 x 90 px: give --camera or --fov-deg"),
        (("map", "small.jpg", "--camera", "lens.json"), "120 x 90 px, expected 160 x 120"),
        (("map", "visit/images/00000.png", "--camera", "other.json"), "expected 320 x 120"),
        (("map", "visit/images/00000.png", "--camera", "broken.json"), "broken.json: Expecting"),
        (("map", "visit/images/00000.png", "--camera", "none.json"), "none.json: fy: Field req"),
        (
            ("map", "visit/images/00000.png", "--camera", "lens.json", "--fov-deg", "90"),
            "--camera and --fov-deg exclude each other",
        ),
        (("map", "visit/images/00000.png", "--depth", "small.jpg"), "small.jpg: 120 x 90"),
        (("map", "visit", "--fov-deg", "90"), "visit: --depth, --camera and --fov-deg are for a"),
        (("bare", "visit"), "bare: it has no landmarks; gslts map makes maps that do"),
        (("map.ply", "visit"), "map.ply: it has no landmarks; gslts map makes maps that do"),
    ],
)
def test_errors_take_one_line(visited: Path, arguments: tuple[str, ...], message: str) -> None:
    done = gslts("localize", *arguments, cwd=visited)
    assert done.returncode == 1
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("gslts: ")
    assert message in line


@pytest.mark.parametrize("command", [("detect",), ("run", "--frames"), ("update", "--frames")])
def test_without_landmarks_nothing_is_localized(visited: Path, command: tuple[str, ...]) -> None:
    verb, *option = command
    done = gslts(verb, "bare", *option, "visit", "--localize", cwd=visited)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line == "gslts: bare: it has no landmarks; gslts map makes maps that do"


def test_a_recording_of_lost_frames_is_an_error(visited: Path, tmp_path: Path) -> None:
    robot = Controller(change_room.home(), **SIZE)
    capture(robot, VIEWPOINTS[:2], tmp_path / "dark")
    for name in ("00000", "00001"):
        darken(tmp_path / "dark", name)
    done = gslts("run", "map", "--frames", tmp_path / "dark", "--localize", cwd=visited)
    assert done.returncode == 1
    message = "dark: none of its frames was localized in the map"
    assert done.stderr.splitlines()[-1].endswith(message)
