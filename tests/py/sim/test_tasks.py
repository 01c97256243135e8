"""Tests of scene change tasks: viewpoints, replay and rejections."""

import json
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from gslts_sim import make_home, write_glb
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.home import Home
from gslts_sim.home_source import FileSource, HomeSource
from gslts_sim.task import VIEWPOINTS, Task, read_task, write_task
from gslts_sim.task_viewpoints import FIRST_VIEW_FRACTION, MAX_NEAR_VIEW_M
from gslts_sim.tasks import TaskMaker, generate_tasks, homes_of

COUNT = 12


@pytest.fixture(scope="module")
def source_and_home() -> tuple[HomeSource, Home]:
    return HomeSource.of_seed("bedroom", 3)


@pytest.fixture(scope="module")
def tasks(source_and_home: tuple[HomeSource, Home]) -> list[Task]:
    settings = TaskSettings(noise="kinect", width=160, height=120)
    return TaskMaker(settings, 0).make(*source_and_home, COUNT)


@pytest.fixture
def task_file(tasks: list[Task], tmp_path: Path) -> Path:
    path = tmp_path / "task.json"
    write_task(next(task for task in tasks if task.change.kind == "relocation"), path)
    return path


def test_kinds_are_balanced_and_changes_differ(tasks: list[Task]) -> None:
    assert len(tasks) == COUNT
    kinds = Counter(task.change.kind for task in tasks)
    assert max(kinds.values()) - min(kinds.values()) <= 2
    assert set(kinds) == {"addition", "removal", "relocation"}
    assert len({(task.change.kind, task.change.object_id) for task in tasks}) == COUNT
    assert all(task.initial_actions == tasks[0].initial_actions for task in tasks), "one map"


def test_changes_in_a_row_start_where_the_one_before_ended(
    tasks: list[Task], source_and_home: tuple[HomeSource, Home]
) -> None:
    source, home = source_and_home
    maker = TaskMaker(TaskSettings(noise="kinect", width=160, height=120), 0)
    row = list(maker.make_sequence(source, home, COUNT))
    assert row[0].initial_actions == tasks[0].initial_actions, "the same map"
    kinds = Counter(task.change.kind for task in row)
    assert max(kinds.values()) - min(kinds.values()) <= 3
    for before, after in pairwise(row):
        assert after.initial_actions == (*before.initial_actions, *before.change_actions)
        ended, starts = before.states(home)[1], after.states(home)[0]
        assert sorted(ended.removed) == sorted(starts.removed)
        for was, is_ in zip(ended.home.objects, starts.home.objects, strict=True):
            assert was.id == is_.id
            np.testing.assert_array_equal(was.world_from_object, is_.world_from_object)


def test_a_home_without_movable_objects_gives_no_changes(
    source_and_home: tuple[HomeSource, Home],
) -> None:
    source, home = source_and_home
    bare = home.without(obj.id for obj in home.objects if obj.movable)
    maker = TaskMaker(TaskSettings(width=160, height=120), 0)
    assert list(maker.make_sequence(source, bare, 3)) == []


def test_the_change_is_made_and_seen(
    tasks: list[Task], source_and_home: tuple[HomeSource, Home]
) -> None:
    _, home = source_and_home
    for task in tasks:
        change = task.change
        for changed, box in ((False, change.box_before), (True, change.box_after)):
            robot = task.start(home, changed=changed)
            event = task.observe(robot, 0)
            assert (change.object_id in robot.home) == (box is not None)
            if box is None:
                continue
            obj = robot.home[change.object_id]
            assert obj.type == change.object_type
            np.testing.assert_allclose(obj.box_in_world, box, atol=1e-6)
            # Counted at another size than that of the search.
            share = event.instance_masks[change.object_id].mean()
            assert 0.7 * FIRST_VIEW_FRACTION[0] <= share <= 1.2 * FIRST_VIEW_FRACTION[1]
        assert (change.kind == "addition") == (change.box_before is None)
        assert (change.kind == "removal") == (change.box_after is None)


def test_test_viewpoints_see_the_change(
    tasks: list[Task], source_and_home: tuple[HomeSource, Home]
) -> None:
    _, home = source_and_home
    for task in tasks[:4]:
        robots = [task.start(home, changed=changed) for changed in (False, True)]
        boxes = [box for box in (task.change.box_before, task.change.box_after) if box]
        middles = np.array(boxes).mean(axis=1)
        for first, viewpoints in (
            (1, task.test_viewpoints.near),
            (1 + VIEWPOINTS, task.test_viewpoints.far),
        ):
            assert len(set(viewpoints)) == VIEWPOINTS
            for number in range(first, first + VIEWPOINTS):
                events = [task.observe(robot, number) for robot in robots]
                masks = [e.instance_masks.get(task.change.object_id, np.zeros(1)) for e in events]
                assert max(int(mask.sum()) for mask in masks) >= 3
                eye = events[0].camera.world_from_camera[:3, 3]
                metres = np.linalg.norm(middles - eye, axis=1)
                assert (
                    (metres < MAX_NEAR_VIEW_M).any()
                    if first == 1
                    else (metres >= MAX_NEAR_VIEW_M).any()
                )


def test_same_seed_same_tasks(tasks: list[Task], source_and_home: tuple[HomeSource, Home]) -> None:
    settings = TaskSettings(noise="kinect", width=160, height=120)
    assert TaskMaker(settings, 0).make(*source_and_home, 3) == tasks[:3]
    assert TaskMaker(settings, 1).make(*source_and_home, 3) != tasks[:3]


def test_scripts_replay_bit_for_bit(task_file: Path) -> None:
    """Replay from the file alone, as on another machine."""

    def images(*numbers: int) -> list[bytes]:
        task = read_task(task_file)
        home = task.home.load(task_file.parent)
        taken: dict[tuple[bool, int], list[bytes]] = {}
        for changed in (False, True):
            robot = task.start(home, changed=changed)
            for number in numbers:
                frame = task.observe(robot, number).observation
                pose = frame.camera.world_from_camera.tobytes()
                taken[changed, number] = [frame.rgb.tobytes(), frame.depth.tobytes(), pose]
        return [part for key in sorted(taken) for part in taken[key]]

    first = images(0, 3, 11)
    assert images(11, 0, 3) == first, "the order of the viewpoints must not count"
    assert len(set(first)) == len(first), "the change, the noise and the move must show"


def test_scripts_come_back(tasks: list[Task], tmp_path: Path) -> None:
    for task in tasks:
        write_task(task, tmp_path / "t.json")
        assert read_task(tmp_path / "t.json") == task
    assert [path.name for path in tmp_path.iterdir()] == ["t.json"]


def edited(path: Path, edit: object) -> Path:
    content = json.loads(path.read_text())
    edit(content)
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda c: c.update(schema_version=2), "schema_version is 2, this gslts reads 1"),
        (lambda c: c.pop("schema_version"), "schema_version: Field required"),
        (lambda c: c.update(comment="hello"), "comment: Extra inputs are not permitted"),
        (lambda c: c["sensor"].update(width=10**9), r"sensor\.width: .*less than or equal to 4096"),
        (lambda c: c["viewpoint"].update(yaw_deg=float("nan")), r"viewpoint\.yaw_deg: .*finite"),
        (
            lambda c: c["change_actions"][0].update(action="Explode"),
            r"change_actions\.0: .*'DisableObject'",
        ),
        (lambda c: c.update(change_actions=[]), "change_actions: .*at least 1 item"),
        (lambda c: c["test_viewpoints"]["far"].pop(), r"test_viewpoints\.far: .*at least 10 items"),
        (lambda c: c["change"].update(kind="addition"), "change: .*does not fit the kind"),
        (lambda c: c["change"].update(box_after=None), "change: .*does not fit the kind"),
        (lambda c: c["change"]["box_after"].reverse(), "change: .*lower corner of a box is above"),
        (lambda c: c.update(schema_version=True), "schema_version: .*valid integer"),
        *[
            (
                lambda c, key=key, value=value: c["change_actions"][0].update({key: value}),
                rf"change_actions\.0\.PlaceObjectAtPoint\.{key}",
            )
            for key, value in [
                ("color", "red"),
                ("rotation", True),
                ("rotation", 1e300),
                ("rotation", "90"),
                ("objectId", ["Mug|1"]),
                ("objectId", ""),
                ("position", {"x": 10**400, "y": 0, "z": 0}),
                ("position", {"x": "1", "y": 0, "z": 0}),
                ("position", {"x": 1, "y": 0}),
                ("self", 3),
            ]
        ],
    ],
)
def test_files_without_a_task_are_named(task_file: Path, edit: object, message: str) -> None:
    with pytest.raises(ValueError, match=message) as error:
        read_task(edited(task_file, edit))
    assert str(error.value).startswith(str(task_file))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("content", [b"", b"[]", b"{", b"\xff\xfe", b"3", b" " * (2 << 20)])
def test_garbage_is_no_task(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "task.json"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"task\.json: "):
        read_task(path)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (
            lambda c: c["change_actions"][0].update(objectId="Mug|99"),
            r"change_actions\[0\]: PlaceObjectAtPoint: there is no Mug\|99",
        ),
        (lambda c: c["change"].update(object_id="Mug|99"), r"Mug\|99 is not as box_before says"),
        (lambda c: c["change"].update(object_type="Banana"), "is not as box_before says"),
        (
            lambda c: c["change"]["box_after"][1].__setitem__(2, 9.0),
            "is not as box_after says",
        ),
        (lambda c: c["viewpoint"].update(x=99.0), r"viewpoint: .*cannot stand"),
        (lambda c: c["viewpoint"].update(x=1e300), r"viewpoint: "),
        (lambda c: c["sensor"].update(noise="loud"), "noise must be one of none, kinect"),
    ],
)
def test_edited_tasks_do_not_start(
    task_file: Path, source_and_home: tuple[HomeSource, Home], edit: object, message: str
) -> None:
    task = read_task(edited(task_file, edit))
    with pytest.raises(ValueError, match=message):
        task.start(source_and_home[1], changed=True)


def test_another_home_is_noticed(task_file: Path) -> None:
    task = read_task(edited(task_file, lambda c: c["home"].update(seed=4)))
    with pytest.raises(ValueError, match="bedroom 4 is not the home of this task"):
        task.home.load(task_file.parent)
    task = read_task(edited(task_file, lambda c: c["home"].update(room_type="attic")))
    with pytest.raises(ValueError, match="room_type: expected one of"):
        task.home.load(task_file.parent)


def test_homes_in_files_are_found_beside_the_script(tmp_path: Path) -> None:
    (tmp_path / "homes").mkdir()
    file = tmp_path / "homes" / "flat.glb"
    write_glb(make_home("kitchen", 2, detail=0.05), file)
    (tmp_path / "tasks").mkdir()
    source, home = FileSource.of_path(file, tmp_path / "tasks")
    assert source.file == "../homes/flat.glb"
    (task,) = TaskMaker(TaskSettings(width=64, height=48), 0).make(source, home, 1)
    write_task(task, tmp_path / "tasks" / "0.json")
    again = read_task(tmp_path / "tasks" / "0.json")
    again.start(again.home.load(tmp_path / "tasks"), changed=True)
    with file.open("ab") as handle:
        handle.write(b"\0")
    with pytest.raises(ValueError, match=r"flat\.glb is not the file of this task"):
        again.home.load(tmp_path / "tasks")


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("/dev/zero", r"zero: tasks need a \.glb file"),
        ("gone.glb", r"gone\.glb: there is no such file"),
        ("flat.gltf", r"flat\.gltf: tasks need a \.glb file, which holds all of its home"),
    ],
)
def test_invalid_files_of_homes_are_rejected(tmp_path: Path, file: str, message: str) -> None:
    (tmp_path / "flat.gltf").write_text("{}")
    with pytest.raises((OSError, ValueError), match=message):
        FileSource(file=file, sha256="0").load(tmp_path)
    (tmp_path / "home.glb").write_bytes(b"glTF")
    with pytest.raises(ValueError, match="relative to its own folder"):
        FileSource(file=str(tmp_path / "home.glb"), sha256="0").load(tmp_path)


def test_one_object_and_one_receptacle_can_be_asked_for(
    source_and_home: tuple[HomeSource, Home],
) -> None:
    source, home = source_and_home
    bear = next(obj for obj in home.objects if obj.type == "TeddyBear")
    settings = TaskSettings(width=64, height=48, object_id=bear.id, receptacle_id="Floor|1")
    tasks = TaskMaker(settings, 0).make(source, home, 3)
    assert {task.change.object_id for task in tasks} == {bear.id}
    assert {task.change.kind for task in tasks} == {"relocation"}
    for task in tasks:
        assert task.start(home, changed=True).home[bear.id].parent == "Floor|1"


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"object_id": "Mug|99"}, r"bedroom 3: there is no Mug\|99"),
        ({"object_id": "Bed|1"}, r"bedroom 3: Bed\|1 is not movable"),
        ({"receptacle_id": "Wall|1"}, r"bedroom 3: there is no receptacle Wall\|1"),
    ],
)
def test_impossible_wishes_are_named(
    source_and_home: tuple[HomeSource, Home], asked: dict[str, str], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        TaskMaker(TaskSettings(**asked), 0).make(*source_and_home, 1)


def test_later_homes_without_the_object_give_no_tasks() -> None:
    settings = TaskSettings(width=16, height=16, object_id="Dumbbell|2")
    maker = TaskMaker(settings, 0)
    tasks = list(generate_tasks(["bedroom"], Path(), 3, 10, 2, maker))
    seeds = {task.home.seed for task in tasks}
    assert min(seeds) == 3
    assert any("there is no Dumbbell|2" in reason for reason in maker.rejected)


def test_rejected_changes_are_counted_by_reason(
    source_and_home: tuple[HomeSource, Home],
) -> None:
    """A second pillow does not fit on a bedside table."""
    source, home = source_and_home
    maker = TaskMaker(TaskSettings(object_id="Pillow|1", receptacle_id="SideTable|1"), 0)
    assert maker.make(source, home, 4) == []
    assert maker.rejected["no room on a SideTable for a Pillow"] > 0


def test_objects_of_a_file_that_stand_on_nothing_stay() -> None:
    """Objects that float or sink, as in many files, cause no failure."""
    home = make_home("bedroom", 2, detail=0.05)
    free = [obj for obj in home.objects if obj.movable][:12]
    for obj in free:
        lifted = obj.world_from_object.copy()
        lifted[2, 3] += 0.02
        home = home.with_object(obj.place_at(lifted, None))
    source = HomeSource(room_type="bedroom", seed=2, sha256="")
    for task in TaskMaker(TaskSettings(width=16, height=16), 0).make(source, home, 6):
        assert task.change.object_id not in {obj.id for obj in free}


def test_files_and_room_types_take_turns(tmp_path: Path) -> None:
    write_glb(make_home("bedroom", 1, detail=0.05), tmp_path / "flat.glb")
    homes = homes_of([str(tmp_path / "flat.glb"), "kitchen"], tmp_path, 5)
    sources = [next(homes)[0] for _ in range(3)]
    assert isinstance(sources[0], FileSource)
    assert [source.seed for source in sources[1:]] == [5, 6]
    with pytest.raises(ValueError, match="'attic'"):
        next(homes_of(["kitchen", "attic"], tmp_path, 0))
