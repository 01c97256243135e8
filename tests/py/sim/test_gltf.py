"""Tests of homes from glTF files."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from gltf_files import CUBE, Gltf, flat, only_object, sized
from home_checks import digest, signed_volume
from PIL import Image

from gslts.core.camera import camera_from_fov, look_at
from gslts_sim import load_home, make_home, write_glb
from gslts_sim.home import Home, HomeObject
from gslts_sim.physics import problems, stands_on
from gslts_sim.raycast import RayCaster
from gslts_sim.walkable import floor_of


@pytest.fixture
def flat_home(tmp_path) -> Home:
    return load_home(flat().write(tmp_path / "flat.glb"))


def world(obj: HomeObject) -> np.ndarray:
    """Return the triangles [F,3,3] of an object in the world."""
    corners = np.concatenate([surface.vertices[surface.faces] for surface in obj.surfaces])
    return corners @ obj.world_from_object[:3, :3].T + obj.world_from_object[:3, 3]


def test_named_nodes_are_objects_and_groups_are_not(flat_home):
    assert [obj.id for obj in flat_home.objects] == [
        *("Floor|1", "Ceiling|1", "Wall|1", "Table|1", "Cup.001", "Cup", "Floor|2"),
    ]
    assert [obj.type for obj in flat_home.objects] == [
        *("Floor", "Ceiling", "Wall", "Table", "Cup", "Cup", "Floor"),
    ]
    assert len(flat_home["Table|1"].surfaces) == 2
    assert flat_home.name == "flat"


def test_rooms_stand_on_their_floors(flat_home):
    kitchen, bedroom = flat_home.rooms
    assert (kitchen.type, bedroom.type) == ("kitchen", "room")
    # The flat is 1 m above the origin in the file, its floors at z = 0 here.
    np.testing.assert_allclose(kitchen.box, [[-2, -1.5, 0], [2, 1.5, 2.6]], atol=1e-6)
    np.testing.assert_allclose(bedroom.box, [[2, -1.5, 0], [6, 1.5, 2.5]], atol=1e-6)
    assert len(flat_home.lights) == 2
    assert flat_home.lights[0].center[2] == pytest.approx(2.5)


def test_turn_about_the_vertical_is_kept_and_scale_applied(flat_home):
    table = flat_home["Table|1"]
    np.testing.assert_allclose(
        table.world_from_object,
        [[0, -1, 0, 1], [1, 0, 0, -0.5], [0, 0, 1, 0], [0, 0, 0, 1]],
        atol=1e-6,
    )
    np.testing.assert_allclose(
        np.stack([table.boxes[:, 0].min(axis=0), table.boxes[:, 1].max(axis=0)]),
        [[-0.9, -0.4, 0], [0.9, 0.4, 0.75]],
        atol=1e-6,
    )
    assert len(table.boxes) == 5
    np.testing.assert_allclose(table.box_in_world, [[0.6, -1.4, 0], [1.4, 0.4, 0.75]], atol=1e-6)


def test_objects_stand_on_their_parents(flat_home):
    parents = {obj.id: obj.parent for obj in flat_home.objects}
    assert parents == {
        "Floor|1": None, "Floor|2": None, "Ceiling|1": None, "Wall|1": None,
        "Table|1": "Floor|1", "Cup": "Table|1", "Cup.001": "Table|1",
    }  # fmt: skip
    assert stands_on(flat_home["Cup"], flat_home["Table|1"])
    assert problems(flat_home) == []


def test_movable_and_receptacle_by_type_and_size(flat_home):
    assert {obj.id for obj in flat_home.objects if obj.movable} == {"Cup", "Cup.001"}
    assert {t.id for t in flat_home.objects if t.receptacle} == {"Floor|1", "Floor|2", "Table|1"}


def test_extras_win_over_type_and_size(tmp_path):
    file = Gltf()
    small = file.mesh(file.primitive(sized(0.55, 0.1, 0.1)))
    extras = {"type": "Relic", "movable": False, "receptacle": True}
    file.node(name="Mug|1", mesh=small, extras=extras)
    obj = only_object(tmp_path, file)
    assert (obj.id, obj.type, obj.movable, obj.receptacle) == (
        "Mug|1",
        "Relic",
        False,
        True,
    )


def test_typed_node_owns_its_subtree_but_for_typed_nodes(tmp_path):
    file = Gltf()
    mesh = file.mesh(file.primitive(CUBE))
    unnamed = file.node(root=False, mesh=mesh)
    named = file.node(root=False, name="Cushion", mesh=mesh, children=[unnamed])
    inner = file.node(root=False, name="Cat", mesh=mesh, extras={"type": "Cat"})
    file.node(name="Seat", children=[named, inner], extras={"type": "Sofa"})
    home = load_home(file.write(tmp_path / "a.glb"))
    assert {obj.id: len(obj.surfaces) for obj in home.objects} == {"Seat": 2, "Cat": 1}
    file.tree["nodes"][3]["extras"] = {}
    home = load_home(file.write(tmp_path / "a.glb"))
    assert {obj.id: len(obj.surfaces) for obj in home.objects} == {"Cushion": 2, "Cat": 1}


def test_names_that_occur_again_are_numbered(tmp_path):
    file = Gltf()
    mesh = file.mesh(file.primitive(CUBE))
    for name in ("Cup", "Cup|2", "Cup", "Cup"):
        file.node(name=name, mesh=mesh)
    home = load_home(file.write(tmp_path / "a.glb"))
    assert [obj.id for obj in home.objects] == ["Cup", "Cup|2", "Cup|3", "Cup|4"]


def test_tilted_object_stands_upright_in_its_own_frame(tmp_path):
    file = Gltf()
    angle = np.radians(30)
    tilt = [np.sin(angle / 2), 0, 0, np.cos(angle / 2)]
    file.node(name="Plank", mesh=file.mesh(file.primitive(sized(1, 0.2, 0.02))), rotation=tilt)
    obj = only_object(tmp_path, file)
    np.testing.assert_array_equal(obj.world_from_object[:3, :3], np.eye(3))
    vertices = obj.surfaces[0].vertices
    assert vertices[:, 2].min() == 0
    height = 0.2 * np.sin(angle) + 0.02 * np.cos(angle)
    assert vertices[:, 2].max() == pytest.approx(height, abs=1e-5)


@pytest.mark.parametrize("scale", [[-1, 1, 1], [1, -2, 1], [-1, -1, -1], [-1, -1, 2]])
def test_mirrors_leave_the_outside_outside(tmp_path, scale):
    file = Gltf()
    child = file.node(root=False, name="Cube", mesh=file.mesh(file.primitive(CUBE)))
    file.node(name="Mirror", children=[child], scale=scale, rotation=[0, 0.6, 0, 0.8])
    surface = only_object(tmp_path, file).surfaces[0]
    volume = signed_volume(surface.vertices, surface.faces)
    assert volume == pytest.approx(abs(np.prod(scale)), rel=1e-5)


def test_shear_of_turn_within_scale_is_applied(tmp_path):
    file = Gltf()
    child = file.node(
        root=False, name="Cube", mesh=file.mesh(file.primitive(CUBE)),
        rotation=[0, np.sin(0.3), 0, np.cos(0.3)],
    )  # fmt: skip
    file.node(name="Wide", children=[child], scale=[3, 1, 1])
    obj = only_object(tmp_path, file)
    turn = trimesh.transformations.rotation_matrix(0.6, [0, 1, 0])
    expected = (CUBE @ turn[:3, :3].T) * (3, 1, 1)
    z_up = np.stack([expected[..., 0], -expected[..., 2], expected[..., 1]], axis=-1)
    z_up[..., 2] += 0.5  # Without a floor, the lowest point is at 0.
    np.testing.assert_allclose(world(obj), z_up, atol=2e-6)


def test_matrix_is_read_by_columns(tmp_path):
    file = Gltf()
    matrix = np.eye(4)
    matrix[:3, 3] = 3, 5, 7
    file.node(name="A", mesh=file.mesh(file.primitive(CUBE)), matrix=matrix.T.ravel().tolist())
    np.testing.assert_allclose(only_object(tmp_path, file).world_from_object[:3, 3], [3, -7, 0])


def test_strips_indices_and_lines(tmp_path):
    file = Gltf()
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
    position = {"POSITION": file.array(points)}
    indices = file.array(np.array([0, 1, 2, 3], np.uint8))
    line = {"attributes": position, "mode": 1}
    mesh = file.mesh(line, {"attributes": position, "indices": indices, "mode": 5})
    file.node(name="Quad", mesh=mesh)
    obj = only_object(tmp_path, file)
    assert len(obj.surfaces) == 1
    corners = world(obj)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(normals, [[0, -1, 0]] * 2, atol=1e-6)  # glTF's +z is our -y.


def test_interleaved_arrays_and_quantised_numbers(tmp_path):
    file = Gltf()
    rows = np.zeros(3, np.dtype([("at", "<i2", 3), ("gap", "<u2"), ("uv", "<u2", 2)]))
    rows["at"] = [[0, 0, 0], [32767, 0, 0], [0, 32767, 0]]
    rows["uv"] = [[0, 0], [65535, 0], [0, 32768]]
    view = file.view(rows.tobytes(), byteStride=rows.itemsize)
    more = {"bufferView": view, "count": 3, "normalized": True}
    file.tree["accessors"] += [
        more | {"componentType": 5122, "type": "VEC3"},
        more | {"componentType": 5123, "type": "VEC2", "byteOffset": 8},
    ]
    file.tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    white = file.material(Image.new("RGB", (2, 2)))
    attributes = {"POSITION": 0, "TEXCOORD_0": 1}
    file.node(name="A", mesh=file.mesh({"attributes": attributes, "material": white}))
    obj = only_object(tmp_path, file)
    np.testing.assert_allclose(np.ptp(obj.surfaces[0].vertices, axis=0), [1, 0, 1])
    expected = np.array([[0, 0], [1, 0], [0, 32768 / 65535]], np.float32)
    np.testing.assert_array_equal(obj.surfaces[0].uvs[0], expected)


@pytest.mark.parametrize("room_type", ["kitchen", "bedroom"])
def test_written_home_comes_back(tmp_path, room_type):
    home = make_home(room_type, 3, detail=0.06)
    write_glb(home, tmp_path / "home.glb")
    again = load_home(tmp_path / "home.glb")
    assert again.rooms[0].type == room_type
    np.testing.assert_allclose(again.rooms[0].box, home.rooms[0].box, atol=1e-5)
    standing = 0
    for obj, other in zip(home.objects, again.objects, strict=True):
        assert (obj.id, obj.type) == (other.id, other.type)
        assert (obj.movable, obj.receptacle) == (other.movable, other.receptacle)
        turns = [item.world_from_object[:3, :3] for item in (obj, other)]
        np.testing.assert_allclose(*turns, atol=1e-6)
        np.testing.assert_allclose(other.box_in_world, obj.box_in_world, atol=1e-5)
        bounds = np.stack([other.boxes[:, 0].min(axis=0), other.boxes[:, 1].max(axis=0)])
        vertices = np.concatenate([surface.vertices for surface in other.surfaces])
        np.testing.assert_allclose(bounds, [vertices.min(axis=0), vertices.max(axis=0)], atol=1e-9)
        standing += obj.parent == other.parent
    # What hangs on walls has no parent then, and pots do not stand on the rings of a burner.
    assert standing > 0.7 * len(home.objects)
    camera = camera_from_fov(80, 60, 1.3, look_at((0.4, 0.4, 1.6), (2, 2, 0.8)))
    first = RayCaster(home).render(camera)
    second = RayCaster(replace(again, lights=home.all_lights, ambient=home.ambient)).render(camera)
    assert (first.instances == second.instances).mean() > 0.99
    assert np.abs(first.radiance - second.radiance).mean() < 0.002


def test_same_file_same_home(tmp_path):
    path = flat().write(tmp_path / "a.glb")
    assert digest(load_home(path)) == digest(load_home(str(path)))


@pytest.mark.parametrize("name", ["a.GLB", "a.GLTF", "a"])
def test_suffixes_do_not_matter(tmp_path, name):
    home = load_home(flat().write(tmp_path / name))
    assert len(home.objects) == 7


def test_file_written_by_trimesh(tmp_path):
    scene = trimesh.Scene()
    cube = trimesh.creation.box((1, 1, 1))
    for name in ("Block|1", "Block|2"):
        at = trimesh.transformations.translation_matrix([float(name[-1]), 0, 0])
        scene.add_geometry(cube, node_name=name, transform=at, metadata={"movable": True})
    scene.export(tmp_path / "a.glb")
    home = load_home(tmp_path / "a.glb")
    assert [obj.id for obj in home.objects] == ["Block|1", "Block|2"]
    assert all(obj.movable for obj in home.objects)


def test_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "home.glb"
    path.write_bytes(b"old")
    written = []
    monkeypatch.setattr(os, "fsync", written.append)
    monkeypatch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(OSError("full")))
    with pytest.raises(OSError, match="full"):
        write_glb(make_home("bedroom", 1, detail=0.03), path)
    assert len(written) == 1
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("named", ["name", "extras"])
def test_a_compound_floor_makes_a_room_on_its_top(tmp_path: Path, named: str) -> None:
    file = Gltf()
    slab = file.mesh(file.primitive(sized(4, 3, 0.3)))
    names = {"name": {"name": "ShopFloor|1"}, "extras": {"extras": {"type": "ShopFloor"}}}
    file.node(mesh=slab, **names[named])
    home = load_home(file.write(tmp_path / "shop.glb"))
    assert home.objects[0].type == "Floor"
    np.testing.assert_allclose(home.rooms[0].box, [[-2, -1.5, 0], [2, 1.5, 2.5]], atol=1e-6)
    assert floor_of(home).can_stand(np.zeros(2))
