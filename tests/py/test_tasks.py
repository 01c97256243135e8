"""Scene change tasks: what they promise, that they replay, and what is refused."""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from gslts.sim.home import Home
from gslts.sim.home_source import FileSource, HomeSource
from gslts.sim.task import Task, read_task, write_task
from gslts.sim.tasks import FIRST_SHARE_PX, NEAR_M, VIEWPOINTS, Setting, TaskMaker

COUNT = 12


@pytest.fixture(scope="module")
def source_and_home() -> tuple[HomeSource, Home]:
    return HomeSource.of_seed("bedroom", 3)


@pytest.fixture(scope="module")
def tasks(source_and_home: tuple[HomeSource, Home]) -> list[Task]:
    setting = Setting(noise="kinect", width=160, height=120)
    return TaskMaker(setting, 0).make(*source_and_home, COUNT)


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


def test_the_change_is_what_happens_and_is_seen(
    tasks: list[Task], source_and_home: tuple[HomeSource, Home]
) -> None:
    _, home = source_and_home
    for task in tasks:
        change = task.change
        for changed, box in ((False, change.box_before), (True, change.box_after)):
            robot = task.start(home, changed=changed)
            event = robot.step("Pass")
            assert (change.object_id in robot.home) == (box is not None)
            if box is None:
                continue
            thing = robot.home[change.object_id]
            assert thing.type == change.object_type
            np.testing.assert_allclose(thing.box_in_world, box, atol=1e-6)
            # Counted at another size than that of the search.
            share = event.instance_masks[change.object_id].mean()
            assert 0.7 * FIRST_SHARE_PX[0] <= share <= 1.2 * FIRST_SHARE_PX[1]
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
        for sort, viewpoints in (
            ("near", task.test_viewpoints.near),
            ("far", task.test_viewpoints.far),
        ):
            assert len(viewpoints) == VIEWPOINTS
            assert len({v.model_dump_json() for v in viewpoints}) == VIEWPOINTS
            for viewpoint in viewpoints:
                seen = 0
                for robot in robots:
                    task.go(robot, viewpoint)
                    masks = robot.step("Pass").instance_masks
                    seen += int(masks.get(task.change.object_id, np.zeros(1)).sum())
                assert seen >= 2
                eye = robots[0].last_event.observation.camera.world_from_camera[:3, 3]
                metres = np.linalg.norm(middles - eye, axis=1)
                assert metres.min() < NEAR_M if sort == "near" else metres.max() >= NEAR_M


def test_same_seed_same_tasks(tasks: list[Task], source_and_home: tuple[HomeSource, Home]) -> None:
    setting = Setting(noise="kinect", width=160, height=120)
    assert TaskMaker(setting, 0).make(*source_and_home, 3) == tasks[:3]
    assert TaskMaker(setting, 1).make(*source_and_home, 3) != tasks[:3]


def test_scripts_replay_bit_for_bit(task_file: Path) -> None:
    """As on another machine: from the file alone, home and all."""

    def pictures() -> list[bytes]:
        task = read_task(task_file)
        home = task.home.load(task_file.parent)
        taken = []
        for changed in (False, True):
            robot = task.start(home, changed=changed)
            for viewpoint in (task.viewpoint, task.test_viewpoints.far[0]):
                task.go(robot, viewpoint)
                frame = robot.observe()
                pose = frame.camera.world_from_camera.tobytes()
                taken += [frame.rgb.tobytes(), frame.depth.tobytes(), pose]
        return taken

    first = pictures()
    assert pictures() == first
    assert len(set(first)) == len(first), "the change, the noise and the move must show"


def test_scripts_are_small_and_come_back(tasks: list[Task], tmp_path: Path) -> None:
    for task in tasks:
        write_task(task, tmp_path / "t.json")
        assert (tmp_path / "t.json").stat().st_size < 8000
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
        (lambda c: c["viewpoint"].update(rotation=float("nan")), r"viewpoint\.rotation: .*finite"),
        (
            lambda c: c["change_actions"][0].update(action="Explode"),
            r"change_actions\.0\.action: .*'DisableObject'",
        ),
    ],
)
def test_files_that_are_no_tasks_are_named(task_file: Path, edit: object, message: str) -> None:
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
            lambda c: c["change_actions"][0]["arguments"].update(objectId="Mug|99"),
            r"change_actions\[0\]: PlaceObjectAtPoint: there is no Mug\|99",
        ),
        (
            lambda c: c["change_actions"][0]["arguments"].update(color="red"),
            r"change_actions\[0\]: .*'color'",
        ),
        (lambda c: c["viewpoint"]["position"].update(x=99.0), r"viewpoint: .*cannot stand"),
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
    from gslts.sim import make_home, write_glb

    (tmp_path / "homes").mkdir()
    file = tmp_path / "homes" / "flat.glb"
    write_glb(make_home("kitchen", 2, detail=0.05), file)
    (tmp_path / "tasks").mkdir()
    source, home = FileSource.of_path(file, tmp_path / "tasks")
    assert source.file == "../homes/flat.glb"
    (task,) = TaskMaker(Setting(width=64, height=48), 0).make(source, home, 1)
    write_task(task, tmp_path / "tasks" / "0.json")
    again = read_task(tmp_path / "tasks" / "0.json")
    again.start(again.home.load(tmp_path / "tasks"), changed=True)
    with file.open("ab") as handle:
        handle.write(b"\0")
    with pytest.raises(ValueError, match=r"flat\.glb is not the file of this task"):
        again.home.load(tmp_path / "tasks")


def test_one_object_and_one_receptacle_can_be_asked_for(
    source_and_home: tuple[HomeSource, Home],
) -> None:
    source, home = source_and_home
    bear = next(thing for thing in home.objects if thing.type == "TeddyBear")
    setting = Setting(width=64, height=48, object_id=bear.id, receptacle_id="Floor|1")
    made = TaskMaker(setting, 0).make(source, home, 3)
    assert {task.change.object_id for task in made} == {bear.id}
    assert {task.change.kind for task in made} == {"relocation"}
    for task in made:
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
        TaskMaker(Setting(**asked), 0).make(*source_and_home, 1)


def test_what_cannot_be_placed_is_counted_with_its_reason(
    source_and_home: tuple[HomeSource, Home],
) -> None:
    """A pillow does not fit on another one's bedside table."""
    source, home = source_and_home
    maker = TaskMaker(Setting(object_id="Pillow|1", receptacle_id="SideTable|1"), 0)
    assert maker.make(source, home, 4) == []
    assert maker.refused["no room on the receptacle"] > 0
