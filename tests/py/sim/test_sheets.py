"""Tests of contact sheets and task sheets: sizes, rooms and unusual names."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sim_scenes
from flats import bare_flat, furnished_flat
from gltf_files import quad
from matplotlib.figure import Figure
from PIL import Image

from gslts_sim import load_home, make_home
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.contact_sheet import corner_cameras, plan_of, write_contact_sheet
from gslts_sim.home import Home, Room
from gslts_sim.home_source import HomeSource
from gslts_sim.task_sheet import write_task_sheet
from gslts_sim.tasks import TaskMaker

MATH = r"Sign $\bad{ and $5"


def texts(home: Home, path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return all texts of a contact sheet."""
    sheets: list[Figure] = []
    save = Figure.savefig

    def keep(figure: Figure, *rest: object, **more: object) -> None:
        sheets.append(figure)
        save(figure, *rest, **more)

    monkeypatch.setattr(Figure, "savefig", keep)
    write_contact_sheet(home, path)
    (sheet,) = sheets
    found = [text.get_text() for axes in sheet.axes for text in axes.texts]
    return found + [axes.get_title() for axes in sheet.axes] + [sheet.get_suptitle()]


@pytest.mark.parametrize("corner", [(4.2, 0), (0, 4.2)])
def test_all_rooms_are_shown(tmp_path, monkeypatch, corner):
    home = furnished_flat(("kitchen", 1, (0, 0)), ("bedroom", 2, corner), detail=0.03)
    found = texts(home, tmp_path / "flat.png", monkeypatch)
    for k, name in enumerate(("room 1: kitchen", "room 2: bedroom")):
        assert found.count(name) == 3  # Two views and the plan.
        assert sum(text.endswith(f"|{k}") for text in found) > 20
    assert not [text for text in found if text.startswith(("Floor|", "Ceiling|1"))]


def test_largest_of_many_rooms_are_shown(tmp_path, monkeypatch):
    sides = [1.0, 3.0, 2.0, 1.5, 2.5]
    home = bare_flat(*((4 * k, 0, 4 * k + side, side) for k, side in enumerate(sides)))
    found = texts(home, tmp_path / "many.png", monkeypatch)
    assert [found.count(f"room {k + 1}: room") for k in range(5)] == [1, 3, 3, 3, 3]


def test_views_are_in_their_room():
    home = bare_flat((0, 0, 3, 3), (3.1, 0, 7, 4))
    for room in home.rooms:
        for camera in corner_cameras(home, 32, 24, room=room):
            eye = camera.world_from_camera[:3, 3]
            assert (room.box[0] < eye).all()
            assert (eye < room.box[1]).all()


def test_plan_hides_the_lower_of_two_ceilings():
    home = bare_flat((0, 0, 3, 3), (3, 0, 6, 3))
    home.rooms[0].box[1, 2] = 2.1
    lids = [
        sim_scenes.box_object(
            f"Ceiling|{x}", (x, 0, z), (x + 3, 3, z + 0.05), sim_scenes.plain(255)
        )
        for x, z in ((0, 2.1), (3, 2.5))
    ]
    covered = replace(home, objects=(*home.objects, *lids))
    np.testing.assert_array_equal(plan_of(covered, home.space), plan_of(home, home.space))


@pytest.mark.parametrize(
    ("size", "shape"),
    [
        ((0.002, 0.001), (100, 200)),
        ((4.0, 3.0), (480, 640)),
        ((100.0, 50.0), (1000, 2000)),
        ((3.0, 0.0), (1, 480)),
    ],
)
def test_pixels_of_plans(size, shape):
    home = sim_scenes.simple_home()
    room = Room("room", np.array([[0, 0, 0], [*size, 2.5]]))
    assert plan_of(replace(home, rooms=(room,)), room).shape == (*shape, 3)


def test_sheet_of_a_tiny_home(tmp_path):
    low, high = (0, 0, 0), (0.002, 0.002, 0.002)
    walls = sim_scenes.box_object("Wall|1", low, high, sim_scenes.plain(200), inward=True)
    home = replace(
        sim_scenes.simple_home(lights=False),
        rooms=(Room("room", np.array([low, high])),),
        objects=(walls,),
    )
    write_contact_sheet(home, tmp_path / "tiny.png")
    with Image.open(tmp_path / "tiny.png") as sheet:
        assert sheet.size == (1650, 704)


def test_sheet_of_a_flat_image(tmp_path):
    home = load_home(quad().write(tmp_path / "image.glb"))
    write_contact_sheet(home, tmp_path / "image.png")
    with Image.open(tmp_path / "image.png") as sheet:
        assert sheet.size == (1650, 704)


def test_names_are_no_formulas(tmp_path, monkeypatch):
    home = sim_scenes.furnished_home()
    mug = replace(home["Mug|1"], id=MATH)
    rest = tuple(obj for obj in home.objects if obj.id != "Mug|1")
    rooms = tuple(Room(MATH, room.box) for room in home.rooms)
    home = replace(home, name=MATH, objects=(*rest, mug), rooms=(*rooms, *rooms))
    found = texts(home, tmp_path / "math.png", monkeypatch)
    assert MATH in found
    assert f"room 1: {MATH}" in found


def test_names_are_no_formulas_on_sheets_of_tasks(tmp_path):
    home = make_home("bedroom", 3, detail=0.05)
    bear = home["TeddyBear|1"]
    home = home.without([bear.id]).with_object(replace(bear, id=MATH))
    source = HomeSource(room_type="bedroom", seed=3, sha256="")
    maker = TaskMaker(TaskSettings(width=32, height=24, object_id=MATH), 0)
    (task,) = maker.make(source, home, 1)
    write_task_sheet(task, home, tmp_path / "task.png")
    with Image.open(tmp_path / "task.png") as image:
        assert image.size[0] > 1000
