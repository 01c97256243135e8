"""The command `gslts bench detect` on one small home: run once, interrupted, with damaged files."""

import json
import shutil
import signal
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import gslts, stopped_at
from PIL import Image

from gslts.core.se3 import rotation_vector
from gslts_bench.detection.cases import Case, HomeCases, take_frame
from gslts_bench.detection.visits import LIGHT_SHIFT_M, move_light, visit_noise
from gslts_bench.homes import BenchHome, HomeSetup
from gslts_sim.actions import SceneState
from gslts_sim.controller import Controller
from gslts_sim.home_source import HomeSource
from gslts_sim.raycast import RayCaster
from gslts_sim.robot_body import robot_camera
from gslts_sim.sensor import NOISE_PRESETS, Sensor
from gslts_sim.task import Task
from gslts_sim.task_viewpoints import FIRST_VIEW_FRACTION

pytestmark = pytest.mark.long

SETTINGS = ("--set", "iterations=40", "--set", "rough_epochs=0", "--set", "voxel_m=0.1")
SMALL = ("--room", "kitchen", "--seeds", "3:4", "--tasks", "6", "--size", "160x120")
RUN = ("bench", "detect", *SMALL, "--frames", "16", *SETTINGS, "--work", "work")
TIMES = ("ms", "cpu_ms")
COUNTS = {"single": 6, "pair": 1, "triple": 1, "unchanged": 4, "shifted": 2}
BENCH = BenchHome("kitchen", 3, HomeSetup(frames=16, width=160, height=120), Path("work"))


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the benchmark ran."""
    folder = tmp_path_factory.mktemp("bench")
    process = gslts(*RUN, "--json", "all.json", "--images", "images", cwd=folder)
    assert process.returncode == 0, process.stderr
    (folder / "stdout").write_text(process.stdout)
    return folder


@pytest.fixture
def copied(done: Path, tmp_path: Path) -> Path:
    """Another folder with the maps, but without results."""
    for name in ("recordings", "maps", "cases"):
        shutil.copytree(done / "work" / name, tmp_path / "work" / name)
    return tmp_path


def lines(folder: Path) -> list[dict[str, Any]]:
    """Return the kept results without times, which differ."""
    (path,) = (folder / "work" / "detect").iterdir()
    results = [json.loads(line) for line in path.read_text().splitlines()]
    return [{key: value for key, value in record.items() if key not in TIMES} for record in results]


def cases_file(folder: Path) -> Path:
    (path,) = (folder / "work" / "cases").glob("kitchen_3_*/cases.json")
    return path


def cases_in(folder: Path) -> HomeCases:
    return HomeCases.model_validate_json(cases_file(folder).read_bytes())


def test_all_is_asked_once_of_each(done: Path) -> None:
    result = json.loads((done / "all.json").read_text())
    asked = Counter((record["part"], record["variant"]) for record in result["records"])
    names = ("objects", "located", "gs_lts")
    all_see = {(part, name): count for part, count in COUNTS.items() for name in names}
    watched = {(part, "watching"): COUNTS[part] for part in ("single", "unchanged")}
    assert asked == all_see | watched
    assert all(record["ms"] > 0 and record["cpu_ms"] > 0 for record in result["records"])
    assert result["errors"] == {}
    single = result["summary"]["detectors"]["objects"]["single"]
    assert single["right"][1] == 6
    assert sum(sum(row.values()) for row in single["confusion"].values()) == 6
    text = (done / "stdout").read_text()
    assert "6 single changes, 1 pairs, 1 triples, 4 visits of unchanged homes, " in text
    assert "2 shifted objects; 1 home(s)" in text
    right, of = single["right"]
    assert (
        f"| one change: type and region right | {100 * right / of:.1f} % ({right} of {of})" in text
    )


def test_images_are_named_by_what_they_show(done: Path) -> None:
    records = json.loads((done / "all.json").read_text())["records"]
    names = [path.stem.split("_") for path in (done / "images").iterdir()]
    shown = {"_".join(name[:4]) for name in names}
    assert 1 <= len(names) == len(shown) <= 20
    assert shown <= {record["case"].replace("/", "_") for record in records}
    assert {name[4] for name in names} == {"objects"}
    assert {name[5] for name in names} <= {"right", "wrong"}
    for path in (done / "images").iterdir():
        with Image.open(path) as image:
            assert image.size == (3 * 480, 360)  # Enlarged, so that words can be read.


def test_nothing_is_made_twice(done: Path) -> None:
    (path,) = (done / "work" / "detect").iterdir()
    before = path.read_bytes()
    maps = [path.stat().st_mtime_ns for path in (done / "work").rglob("versions.sqlite")]
    assert len(maps) == 1
    again = gslts(*RUN, cwd=done)
    assert again.returncode == 0, again.stderr
    tables = [text.partition("|")[2] for text in (again.stdout, (done / "stdout").read_text())]
    assert tables[0] == tables[1], "the same tables, to the last time"
    assert path.read_bytes() == before
    assert [path.stat().st_mtime_ns for path in (done / "work").rglob("versions.sqlite")] == maps


def test_a_killed_run_goes_on_where_it_stopped(done: Path, copied: Path) -> None:
    at_the_third = stopped_at("gslts.fleet.jobs:_count", 3)
    killed = gslts(*RUN, cwd=copied, before=at_the_third, session=True)
    assert killed.returncode == -signal.SIGKILL
    kept = list((copied / "work").glob("detect/*"))
    first = kept[0].read_bytes()
    assert first.count(b"\n") >= 3
    again = gslts(*RUN, cwd=copied)
    assert again.returncode == 0, again.stderr
    assert kept[0].read_bytes().startswith(first)
    assert lines(copied) == lines(done)


def test_a_task_that_errors_is_named_and_ends_in_1(done: Path, copied: Path) -> None:
    path = cases_file(copied)
    content = json.loads(path.read_text())
    content["cases"][1]["viewpoint"]["x"] = 1000.0
    path.write_text(json.dumps(content))
    spoilt = gslts(*RUN, "--json", "all.json", cwd=copied)
    assert spoilt.returncode == 1
    assert "Traceback" not in spoilt.stderr
    assert "gslts: 4 results failed, named above" in spoilt.stderr
    assert (
        "kitchen_3/single_01: objects: ActionError: Teleport: the robot cannot stand at"
        in spoilt.stderr
    )
    assert "5 single changes" in spoilt.stdout
    assert "type and region right" in spoilt.stdout, "the table comes all the same"
    result = json.loads((copied / "all.json").read_text())
    assert {name.rpartition(":")[0] for name in result["errors"]} == {"kitchen_3/single_01"}
    path.write_bytes(cases_file(done).read_bytes())
    healed = gslts(*RUN, cwd=copied)
    assert healed.returncode == 0, healed.stderr
    errors = [record for record in lines(copied) if record["error"] is not None]
    assert len(errors) == 4, "one for each detector"
    rest = [record for record in lines(copied) if record["error"] is None]
    assert sorted(map(str, rest)) == sorted(map(str, lines(done)))


def test_a_home_that_fails_is_named(copied: Path) -> None:
    (manifest,) = (copied / "work").glob("maps/*/manifest.json")
    manifest.write_text("{}")
    spoilt = gslts(*RUN, cwd=copied)
    assert spoilt.returncode == 1
    assert "kitchen_3: ValueError:" in spoilt.stderr
    assert "not the manifest of a map" in spoilt.stderr


def test_the_trade_is_measured_and_drawn(copied: Path) -> None:
    process = gslts(*RUN, "--trade", "trade.png", "--json", "all.json", cwd=copied)
    assert process.returncode == 0, process.stderr
    assert "### Speed against accuracy" in process.stdout
    result = json.loads((copied / "all.json").read_text())
    parts = Counter(
        record["part"] for record in result["records"] if record["variant"] == "quarter, gradients"
    )
    assert parts == {"single": 6}
    with Image.open(copied / "trade.png") as image:
        assert image.size[0] > 500


def test_single_cases_are_tasks(done: Path) -> None:
    """Frames are those of `Task.start`, to the last bit."""
    cases = cases_in(done)
    tasks: list[Task] = BENCH.tasks(12)
    home = BENCH.load()
    before = BENCH.default_state(cases.initial_actions)
    for case, task in zip(cases.cases[:2], tasks, strict=False):
        ours = take_frame(case, before, BENCH)
        theirs = task.start(home, changed=True).observe()
        np.testing.assert_array_equal(ours.rgb, theirs.rgb)
        np.testing.assert_array_equal(ours.depth, theirs.depth)
        assert case.truths[0].change == task.change


def test_several_changes_are_all_seen(done: Path) -> None:
    """Each from the same viewpoint, before and after all of them, as a single task must be."""
    cases = cases_in(done)
    before = BENCH.default_state(cases.initial_actions)
    several = [case for case in cases.cases if case.part in ("pair", "triple")]
    assert [len(case.truths) for case in several] == [2, 3]
    for case in several:
        after = before
        for action in case.actions:
            after = after.apply(action)
        assert len({truth.change.object_id for truth in case.truths}) == len(case.truths)
        for truth in case.truths:
            change, counted = truth.change, []
            for state, box in ((before, change.box_before), (after, change.box_after)):
                assert (change.object_id in state.home) == (box is not None)
                if box is None:
                    continue
                np.testing.assert_allclose(
                    state.home[change.object_id].box_in_world, box, atol=1e-5
                )
                counted.append(seen_px(state, case, change.object_id))
            assert min(counted) == truth.size_px
            # At another size than that of the search.
            assert truth.size_px >= 0.7 * FIRST_VIEW_FRACTION[0] * 640 * 480


def seen_px(state: SceneState, case: Case, object_id: str) -> int:
    robot = Controller(state)
    robot.go(case.viewpoint)
    masks = robot.step("Pass").instance_masks
    return int(masks[object_id].sum()) if object_id in masks else 0


def test_visits_err_as_they_should(done: Path) -> None:
    """Poses by 1 cm and half a degree, each visit with another exposure and lamp."""
    cases = cases_in(done)
    before = BENCH.default_state(cases.initial_actions)
    visits = [case for case in cases.cases if case.part == "unchanged"]
    assert len(visits) == COUNTS["unchanged"]
    assert len({case.sensor_seed for case in visits}) == len(visits)
    transforms = json.loads(next((done / "work").rglob("transforms.json")).read_text())
    recorded = np.array([frame["true_transform_matrix"] for frame in transforms["frames"]])[
        :, :3, 3
    ]
    for case in visits:
        assert case.light_shift_m is not None
        assert np.linalg.norm(case.light_shift_m) == pytest.approx(LIGHT_SHIFT_M, abs=1e-3)
        assert not case.actions
        near = np.linalg.norm(recorded[:, :2] - [case.viewpoint.x, case.viewpoint.y], axis=1)
        assert near.min() > 0.001
    true = robot_camera(before.home, visits[0].viewpoint, (160, 120))
    noise = visit_noise(NOISE_PRESETS["kinect"])
    caster = RayCaster(before.home)
    poses = [Sensor(noise, seed).take(caster, true, 0)[0].camera for seed in range(60)]
    motions = [np.linalg.inv(true.world_from_camera) @ camera.world_from_camera for camera in poses]
    metres = [np.linalg.norm(motion[:3, 3]) for motion in motions]
    degrees = [np.rad2deg(np.linalg.norm(rotation_vector(motion[:3, :3]))) for motion in motions]
    assert np.sqrt(np.mean(np.square(metres))) == pytest.approx(0.01, rel=0.15)
    assert np.sqrt(np.mean(np.square(degrees))) == pytest.approx(0.5, rel=0.15)
    seen = take_frame(visits[0].model_copy(update={"sensor_seed": 7}), before, BENCH)
    np.testing.assert_array_equal(seen.camera.world_from_camera, poses[7].world_from_camera)


def test_the_light_moves_and_the_lamp_does_not(done: Path) -> None:
    _, home = HomeSource.of_seed("bedroom", 1)
    moved = move_light(home, (0.3, -0.4))
    changed = [
        new.center - old.center
        for old, new in zip(home.all_lights, moved.all_lights, strict=True)
        if not np.array_equal(old.center, new.center)
    ]
    assert len(changed) == 1
    np.testing.assert_allclose(changed[0], [0.3, -0.4, 0], atol=1e-9)
    assert [thing.id for thing in moved.objects] == [thing.id for thing in home.objects]
    for old, new in zip(home.objects, moved.objects, strict=True):
        np.testing.assert_array_equal(old.box_in_world, new.box_in_world)
    cases = cases_in(done)
    before = BENCH.default_state(cases.initial_actions)
    visit = next(case for case in cases.cases if case.part == "unchanged")
    views = [
        take_frame(case, before, BENCH).rgb.astype(float)
        for case in (visit, visit.model_copy(update={"light_shift_m": None}))
    ]
    assert np.abs(views[0] - views[1]).mean() > 0.2, "it must be seen"
