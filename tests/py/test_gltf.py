"""Homes from glTF files: what they mean, and files that are wrong."""

import base64
import io
import json
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from gltf_files import Gltf, box, glb, y_up
from home_checks import signed_volume
from PIL import Image
from test_homes import digest

from gslts.camera import camera_from_fov, look_at
from gslts.sim import gltf_colour, gltf_file, gltf_parts, load_home, make_home, write_glb
from gslts.sim.home import Home, HomeObject
from gslts.sim.physics import problems, stands_on
from gslts.sim.raycast import RayCaster
from gslts.sim.texture_atlas import LINEAR_OF_BYTE, srgb_from_linear

CUBE = y_up(box([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]))


def sized(width: float, depth: float, height: float) -> np.ndarray:
    """A box in glTF's axes, standing on the origin, the sizes in ours."""
    return y_up(box([-width / 2, -depth / 2, 0], [width / 2, depth / 2, height]))


def flat() -> Gltf:
    """Two rooms, nested as Blender does it: groups, a shared mesh, parents of things."""
    file = Gltf()
    wood = file.material(baseColorFactor=[0.5, 0.3, 0.2, 1])
    cup = file.mesh(file.primitive(sized(0.08, 0.08, 0.1), material=wood))
    top = file.primitive(y_up(box([-0.6, -0.4, 0.71], [0.6, 0.4, 0.75])), material=wood)
    legs = [
        box([x - 0.03, y - 0.03, 0], [x + 0.03, y + 0.03, 0.71])
        for x in (-0.5, 0.5)
        for y in (-0.3, 0.3)
    ]
    table = file.mesh(top, file.primitive(y_up(np.concatenate(legs))))
    floor = file.mesh(file.primitive(sized(4, 3, 0.1)))
    wall = file.mesh(file.primitive(sized(4, 0.1, 2.5)))
    ceiling = file.mesh(file.primitive(sized(4, 3, 0.1)))
    first = file.node(
        root=False, name="Cup.001", mesh=cup, translation=[0.2, 0.75, 0.1], extras={"movable": 1}
    )
    second = file.node(root=False, name="Cup", mesh=cup, translation=[-0.2, 0.75, 0.1])
    half = np.sqrt(0.5)
    # A quarter turn about the vertical; the scale is applied to the vertices.
    turned = {"translation": [1, 0, 0.5], "rotation": [0, half, 0, half], "scale": [1.5, 1, 1]}
    desk = file.node(root=False, name="Table|1", mesh=table, children=[first, second], **turned)
    kitchen = [
        file.node(root=False, name="Floor|1", mesh=floor, translation=[0, -0.1, 0],
                  extras={"room": "kitchen"}),
        file.node(root=False, name="Ceiling|1", mesh=ceiling, translation=[0, 2.6, 0]),
        file.node(root=False, name="Wall|1", mesh=wall, translation=[0, 0, -1.45]),
        desk,
    ]  # fmt: skip
    group = file.node(root=False, name="Kitchen", children=kitchen, extras={"type": "Room"})
    bed = file.node(root=False, name="Floor|2", mesh=floor, translation=[4, -0.1, 0])
    file.node(name="Flat", children=[group, bed], translation=[0, 1, 0])
    return file


@pytest.fixture
def flat_home(tmp_path) -> Home:
    return load_home(flat().write(tmp_path / "flat.glb"))


def one(tmp_path: Path, file: Gltf) -> HomeObject:
    """The only object of a file."""
    return load_home(file.write(tmp_path / "one.glb")).objects[0]


def world(thing: HomeObject) -> np.ndarray:
    """[F,3,3] its triangles in the world."""
    corners = np.concatenate([surface.vertices[surface.faces] for surface in thing.surfaces])
    return corners @ thing.world_from_object[:3, :3].T + thing.world_from_object[:3, 3]


def test_named_nodes_are_objects_and_groups_are_not(flat_home):
    assert [thing.id for thing in flat_home.objects] == [
        *("Floor|1", "Ceiling|1", "Wall|1", "Table|1", "Cup.001", "Cup", "Floor|2"),
    ]
    assert [thing.type for thing in flat_home.objects] == [
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


def test_things_stand_on_what_carries_them(flat_home):
    parents = {thing.id: thing.parent for thing in flat_home.objects}
    assert parents == {
        "Floor|1": None, "Floor|2": None, "Ceiling|1": None, "Wall|1": None,
        "Table|1": "Floor|1", "Cup": "Table|1", "Cup.001": "Table|1",
    }  # fmt: skip
    assert stands_on(flat_home["Cup"], flat_home["Table|1"])
    assert problems(flat_home) == []


def test_movable_and_receptacle_by_type_and_size(flat_home):
    assert {thing.id for thing in flat_home.objects if thing.movable} == {"Cup", "Cup.001"}
    assert {t.id for t in flat_home.objects if t.receptacle} == {"Floor|1", "Floor|2", "Table|1"}


def test_extras_win_over_type_and_size(tmp_path):
    file = Gltf()
    small = file.mesh(file.primitive(sized(0.1, 0.1, 0.1)))
    extras = {"type": "Relic", "movable": False, "receptacle": True}
    file.node(name="Mug|1", mesh=small, extras=extras)
    thing = one(tmp_path, file)
    assert (thing.id, thing.type, thing.movable, thing.receptacle) == (
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
    assert {thing.id: len(thing.surfaces) for thing in home.objects} == {"Seat": 2, "Cat": 1}
    file.tree["nodes"][3]["extras"] = {}
    home = load_home(file.write(tmp_path / "a.glb"))
    assert {thing.id: len(thing.surfaces) for thing in home.objects} == {"Cushion": 2, "Cat": 1}


def test_names_that_occur_again_are_numbered(tmp_path):
    file = Gltf()
    mesh = file.mesh(file.primitive(CUBE))
    for name in ("Cup", "Cup|2", "Cup", "Cup"):
        file.node(name=name, mesh=mesh)
    home = load_home(file.write(tmp_path / "a.glb"))
    assert [thing.id for thing in home.objects] == ["Cup", "Cup|2", "Cup|3", "Cup|4"]


def test_tilted_object_stands_upright_in_its_own_frame(tmp_path):
    file = Gltf()
    angle = np.radians(30)
    tilt = [np.sin(angle / 2), 0, 0, np.cos(angle / 2)]
    file.node(name="Plank", mesh=file.mesh(file.primitive(sized(1, 0.2, 0.02))), rotation=tilt)
    thing = one(tmp_path, file)
    np.testing.assert_array_equal(thing.world_from_object[:3, :3], np.eye(3))
    vertices = thing.surfaces[0].vertices
    assert vertices[:, 2].min() == 0
    height = 0.2 * np.sin(angle) + 0.02 * np.cos(angle)
    assert vertices[:, 2].max() == pytest.approx(height, abs=1e-5)


@pytest.mark.parametrize("scale", [[-1, 1, 1], [1, -2, 1], [-1, -1, -1], [-1, -1, 2]])
def test_mirrors_leave_the_outside_outside(tmp_path, scale):
    file = Gltf()
    child = file.node(root=False, name="Cube", mesh=file.mesh(file.primitive(CUBE)))
    file.node(name="Mirror", children=[child], scale=scale, rotation=[0, 0.6, 0, 0.8])
    surface = one(tmp_path, file).surfaces[0]
    volume = signed_volume(surface.vertices, surface.faces)
    assert volume == pytest.approx(abs(np.prod(scale)), rel=1e-5)


def test_shear_of_turn_within_scale_is_applied(tmp_path):
    file = Gltf()
    child = file.node(
        root=False, name="Cube", mesh=file.mesh(file.primitive(CUBE)),
        rotation=[0, np.sin(0.3), 0, np.cos(0.3)],
    )  # fmt: skip
    file.node(name="Wide", children=[child], scale=[3, 1, 1])
    thing = one(tmp_path, file)
    turn = trimesh.transformations.rotation_matrix(0.6, [0, 1, 0])
    expected = (CUBE @ turn[:3, :3].T) * (3, 1, 1)
    z_up = np.stack([expected[..., 0], -expected[..., 2], expected[..., 1]], axis=-1)
    z_up[..., 2] += 0.5  # Without a floor, the lowest point is at 0.
    np.testing.assert_allclose(world(thing), z_up, atol=2e-6)


def test_matrix_is_read_by_columns(tmp_path):
    file = Gltf()
    matrix = np.eye(4)
    matrix[:3, 3] = 3, 5, 7
    file.node(name="A", mesh=file.mesh(file.primitive(CUBE)), matrix=matrix.T.ravel().tolist())
    np.testing.assert_allclose(one(tmp_path, file).world_from_object[:3, 3], [3, -7, 0])


def test_strips_indices_and_lines(tmp_path):
    file = Gltf()
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
    position = {"POSITION": file.array(points)}
    indices = file.array(np.array([0, 1, 2, 3], np.uint8))
    line = {"attributes": position, "mode": 1}
    mesh = file.mesh(line, {"attributes": position, "indices": indices, "mode": 5})
    file.node(name="Quad", mesh=mesh)
    thing = one(tmp_path, file)
    assert len(thing.surfaces) == 1
    corners = world(thing)
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
    thing = one(tmp_path, file)
    np.testing.assert_allclose(np.ptp(thing.surfaces[0].vertices, axis=0), [1, 0, 1])
    expected = np.array([[0, 0], [1, 0], [0, 32768 / 65535]], np.float32)
    np.testing.assert_array_equal(thing.surfaces[0].uvs[0], expected)


# Colours.

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
QUAD_UV = np.array([[0, 1], [1, 1], [1, 0], [0, 1], [1, 0], [0, 0]], np.float32)


def quad(image: Image.Image | None = None, uv: np.ndarray = QUAD_UV, **look: object) -> Gltf:
    """A square in glTF's x and y, the image upright on it."""
    file = Gltf()
    attributes = {"TEXCOORD_0": file.array(uv)}
    material = file.material(image, **look)
    primitive = file.primitive(QUAD, attributes=attributes, material=material)
    file.node(name="Picture", mesh=file.mesh(primitive))
    return file


def four_colours() -> Image.Image:
    pixels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [200, 100, 50]]], np.uint8)
    return Image.fromarray(pixels)


def test_textures_are_upright(tmp_path):
    large = four_colours().resize((32, 32), Image.Resampling.NEAREST)
    home = load_home(quad(large).write(tmp_path / "a.glb"))
    home = replace(home, lights=(), ambient=np.ones(3))
    # glTF's front is our -y side.
    camera = camera_from_fov(64, 64, 0.8, look_at((0.5, -1.4, 0.5), (0.5, 0, 0.5)))
    radiance = RayCaster(home).look(camera).radiance
    seen = radiance[[16, 16, 48, 48], [16, 48, 16, 48]]
    expected = LINEAR_OF_BYTE[np.asarray(four_colours()).reshape(4, 3)]
    np.testing.assert_allclose(seen, expected, atol=0.05)


def test_texture_bytes_and_coordinates_are_untouched(tmp_path):
    surface = one(tmp_path, quad(four_colours(), 2.5 * QUAD_UV)).surfaces[0]
    np.testing.assert_array_equal(surface.texture, np.asarray(four_colours()))
    np.testing.assert_array_equal(surface.uvs.reshape(-1, 2), 2.5 * QUAD_UV)


def test_factor_is_multiplied_in_linear_light(tmp_path):
    factor = np.array([0.5, 0.25, 1.0])
    texture = (
        one(tmp_path, quad(four_colours(), baseColorFactor=[*factor, 0.3])).surfaces[0].texture
    )
    linear = LINEAR_OF_BYTE[np.asarray(four_colours())] * factor
    np.testing.assert_array_equal(texture, np.rint(255 * srgb_from_linear(linear)))
    assert texture[0, 0, 0] == 188  # Half the light of 255 in sRGB.


def test_factor_without_a_texture_is_the_colour(tmp_path):
    texture = one(tmp_path, quad(baseColorFactor=[0.2158605, 1, 0, 1])).surfaces[0].texture
    assert texture.tolist() == [[[128, 255, 0]]]


@pytest.mark.parametrize("mode", ["RGBA", "L", "LA", "P", "I;16"])
def test_other_kinds_of_images(tmp_path, mode):
    if mode == "I;16":
        image = Image.fromarray(np.array([[0, 65535], [32768, 256]], np.uint16))
        expected = [[0, 255], [128, 1]]
    else:
        image = Image.fromarray(np.array([[0, 255], [128, 1]], np.uint8)).convert(mode)
        if mode == "RGBA":
            image.putalpha(40)
        expected = [[0, 255], [128, 1]]
    texture = one(tmp_path, quad(image)).surfaces[0].texture
    np.testing.assert_array_equal(texture, np.repeat(np.array(expected)[..., None], 3, axis=2))


def test_palette_with_opacity(tmp_path):
    image = four_colours().quantize(4)
    image.info["transparency"] = bytes([0, 128, 255, 255])
    texture = one(tmp_path, quad(image)).surfaces[0].texture
    np.testing.assert_array_equal(texture, np.asarray(four_colours()))


def test_transform_of_textures(tmp_path):
    # The quadrant at the lower left, turned by 90 degrees: the example of the extension.
    change = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5], "texCoord": 1}
    file = quad(four_colours(), baseColorTexture={"extensions": {"KHR_texture_transform": change}})
    attributes = file.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes["TEXCOORD_1"], attributes["TEXCOORD_0"] = attributes["TEXCOORD_0"], 0
    uvs = one(tmp_path, file).surfaces[0].uvs.reshape(-1, 2)
    np.testing.assert_allclose(uvs.min(axis=0), [0, 0.5], atol=1e-6)
    np.testing.assert_allclose(uvs.max(axis=0), [0.5, 1], atol=1e-6)
    np.testing.assert_allclose(uvs[1], [0.5, 0.5], atol=1e-6)  # From (1, 1).


def test_colours_at_vertices(tmp_path):
    file = quad(baseColorFactor=[1, 0.5, 1, 1])
    colours = np.array([[1, 1, 0]] * 3 + [[0, 0, 1]] * 3, np.float32)
    primitive = file.tree["meshes"][0]["primitives"][0]
    primitive["attributes"]["COLOR_0"] = file.array(colours)
    surface = one(tmp_path, file).surfaces[0]
    height, width = surface.texture.shape[:2]
    column, row = np.floor(surface.uvs[:, 0] * (width, height)).astype(int).T
    assert surface.texture[row, column].tolist() == [[255, 188, 0], [0, 0, 255]]


def test_image_beside_the_file(tmp_path):
    (tmp_path / "images").mkdir()
    four_colours().save(tmp_path / "images" / "four colours.png")
    file = quad(four_colours())
    file.tree["images"][0] = {"uri": "images/four%20colours.png"}
    uri = "data:application/octet-stream;base64," + base64.b64encode(file.data).decode()
    file.tree["buffers"] = [{"uri": uri, "byteLength": len(file.data)}]
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(file.tree))
    texture = load_home(path).objects[0].surfaces[0].texture
    np.testing.assert_array_equal(texture, np.asarray(four_colours()))


# Whole homes.


@pytest.mark.parametrize("room_type", ["kitchen", "bedroom"])
def test_written_home_comes_back(tmp_path, room_type):
    home = make_home(room_type, 3, detail=0.06)
    write_glb(home, tmp_path / "home.glb")
    again = load_home(tmp_path / "home.glb")
    assert again.rooms[0].type == room_type
    np.testing.assert_allclose(again.rooms[0].box, home.rooms[0].box, atol=1e-5)
    standing = 0
    for thing, other in zip(home.objects, again.objects, strict=True):
        assert (thing.id, thing.type) == (other.id, other.type)
        assert (thing.movable, thing.receptacle) == (other.movable, other.receptacle)
        turns = [one.world_from_object[:3, :3] for one in (thing, other)]
        np.testing.assert_allclose(*turns, atol=1e-6)
        np.testing.assert_allclose(other.box_in_world, thing.box_in_world, atol=1e-5)
        bounds = np.stack([other.boxes[:, 0].min(axis=0), other.boxes[:, 1].max(axis=0)])
        vertices = np.concatenate([surface.vertices for surface in other.surfaces])
        np.testing.assert_allclose(bounds, [vertices.min(axis=0), vertices.max(axis=0)], atol=1e-9)
        standing += thing.parent == other.parent
    # What hangs on walls has no parent then, and pots do not stand on the rings of a burner.
    assert standing > 0.7 * len(home.objects)
    camera = camera_from_fov(80, 60, 1.3, look_at((0.4, 0.4, 1.6), (2, 2, 0.8)))
    first = RayCaster(home).look(camera)
    second = RayCaster(replace(again, lights=home.lights, ambient=home.ambient)).look(camera)
    assert (first.instances == second.instances).mean() > 0.99
    assert np.abs(first.radiance - second.radiance).mean() < 0.002


def test_same_file_same_home(tmp_path):
    path = flat().write(tmp_path / "a.glb")
    assert digest(load_home(path)) == digest(load_home(str(path)))


def test_file_written_by_trimesh(tmp_path):
    scene = trimesh.Scene()
    cube = trimesh.creation.box((1, 1, 1))
    for name in ("Block|1", "Block|2"):
        at = trimesh.transformations.translation_matrix([float(name[-1]), 0, 0])
        scene.add_geometry(cube, node_name=name, transform=at, metadata={"movable": True})
    scene.export(tmp_path / "a.glb")
    home = load_home(tmp_path / "a.glb")
    assert [thing.id for thing in home.objects] == ["Block|1", "Block|2"]
    assert all(thing.movable for thing in home.objects)


def test_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "home.glb"
    path.write_bytes(b"old")
    monkeypatch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(OSError("full")))
    with pytest.raises(OSError, match="full"):
        write_glb(make_home("bedroom", 1, detail=0.03), path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


# Files that are wrong.


def assert_refused(path: Path, match: str, error: type[Exception] = ValueError) -> None:
    with pytest.raises(error, match=match) as caught:
        load_home(path)
    message = str(caught.value)
    assert path.name in message
    assert "\n" not in message
    assert len(message) < 600


def test_file_cut_short_at_any_byte(tmp_path):
    file = quad(four_colours())
    data = file.glb()
    path = tmp_path / "cut.glb"
    for length in range(len(data)):
        path.write_bytes(data[:length])
        assert_refused(path, "load_home: ")


def test_any_wrong_byte_is_refused_or_read(tmp_path):
    data = quad(four_colours()).glb()
    rng = np.random.default_rng(5)
    path = tmp_path / "wrong.glb"
    for _ in range(400):
        wrong = bytearray(data)
        for place in rng.integers(0, len(data), 3):
            wrong[place] = rng.integers(256)
        path.write_bytes(wrong)
        try:
            load_home(path)
        except (ValueError, OSError) as error:
            assert "wrong.glb" in str(error)  # noqa: PT017
            assert "\n" not in str(error)  # noqa: PT017


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda data: b"glTX" + data[4:], "it is no glTF"),
        (lambda data: data[:4] + struct.pack("<I", 1) + data[8:], "glTF 1, not 2"),
        (lambda data: data[:8] + struct.pack("<I", 2**32 - 1) + data[12:], "4294967295 bytes"),
        (lambda data: data[:12] + struct.pack("<I", 2**32 - 1) + data[16:], "is not its JSON"),
        (lambda data: data[:16] + b"BIN\0" + data[20:], "is not its JSON"),
        (lambda _: b"", "it is no glTF"),
        (lambda _: b"ply\nformat ascii 1.0\n", "it is no glTF"),
        (lambda _: b"[" * 100_000, "it is no glTF"),
        (lambda _: b"[1, 2]", "asset.version is None"),
        (lambda _: b'{"asset": {"version": "1.0"}}', "asset.version is '1.0'"),
        (lambda _: b'{"asset": {"version": "2.0", "x": NaN}}', "NaN is not a number"),
        (lambda _: b'{"asset": {"version": "2.0"}}', "no node has a mesh"),
        (lambda _: b'{"asset": {"version": "2.0"}, "nodes": 3}', "nodes: expected a list"),
    ],
)  # fmt: skip
def test_containers_that_lie(tmp_path, change, match):
    path = tmp_path / "bad.glb"
    path.write_bytes(change(flat().glb()))
    assert_refused(path, match)


def edit(*keys, value):
    """A function that sets an entry deep in a tree."""

    def change(file: Gltf) -> None:
        tree = file.tree
        for key in keys[:-1]:
            tree = tree[key]
        tree[keys[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (edit("nodes", 0, value={"mesh": 0}), "node 0 has a mesh, but neither it nor a node above"),
        (edit("nodes", 0, "mesh", value=7), r"meshes\[7\] does not exist"),
        (edit("nodes", 0, "children", value=[0]), r"node 0 \(Picture\) is a child more than once"),
        (edit("nodes", 0, "children", value=[-1]), "its child -1 does not exist"),
        (edit("nodes", 0, "translation", value=["a", 0, 0]), "trimesh cannot read it"),
        (edit("nodes", 0, "scale", value=[1e30, 1, 1]), "a vertex is over 10000 m from"),
        (edit("nodes", 0, "scale", value=[1e400, 1, 1]), "Infinity is not a number"),
        (edit("nodes", 0, "scale", value=[0, 0, 0]), "only degenerate ones"),
        (edit("nodes", 0, "extras", value={"movable": "yes"}), "extras.movable is 'yes'"),
        (edit("nodes", 0, "extras", value={"type": ""}), "extras.type is ''"),
        (edit("scenes", 0, "nodes", value=[3]), "a root of the scene does not exist"),
        (edit("scenes", value=[{"nodes": 3}]), "a root of the scene does not exist"),
        (edit("meshes", 0, "primitives", value=[]), r"node 0 \(Picture\): its mesh has no triang"),
        (edit("meshes", 0, "primitives", 0, "mode", value=1), "its mesh has no triangles"),
        (edit("meshes", 0, "primitives", 0, "mode", value=6), "fans are not supported"),
        (edit("meshes", 0, "primitives", 0, "attributes", value={}), "has no POSITION"),
        (edit("meshes", 0, "primitives", 0, "attributes", value=[3]), "damaged"),
        (edit("meshes", 0, "primitives", 0, "indices", value=1), "is not a list of SCALAR"),
        (edit("accessors", 1, "count", value=2**40), "1099511627776 entries"),
        (edit("accessors", 1, "count", value=0), "is not a list of VEC3"),
        (edit("accessors", 1, "count", value=-3), "is not a list of VEC3"),
        (edit("accessors", 1, "count", value=3), r"arrays of a primitive have \[3, 6\] entries"),
        (edit("accessors", 1, "byteOffset", value=2**62), "its 72 bytes hold fewer"),
        (edit("accessors", 1, "componentType", value=1), "is not a list of VEC3"),
        (edit("accessors", 1, "sparse", value={"count": 1}), "is sparse"),
        (edit("accessors", 1, value={"componentType": 5126, "count": 10**12, "type": "VEC3"}),
         "has no data"),
        (edit("bufferViews", 0, "byteStride", value=0), "rows of 8 bytes, 0 apart"),
        (edit("bufferViews", 0, "byteStride", value=10**15), "hold fewer"),
        (edit("bufferViews", 0, "byteLength", value=10**15), "1000000000000000 bytes"),
        (edit("bufferViews", 0, "buffer", value=1), r"buffers\[1\] does not exist"),
        (edit("materials", 0, "pbrMetallicRoughness", "baseColorFactor", value=[1]), "4 numbers"),
        (edit("textures", 0, value={}), "has no PNG, JPEG or WebP image"),
        (edit("images", 0, value={"uri": "/etc/passwd"}), "not lead into the folder"),
        (edit("images", 0, value={"uri": "../a.png"}), "not lead into the folder"),
        (edit("images", 0, value={"uri": "%2e%2e/a.png"}), "not lead into the folder"),
        (edit("images", 0, value={"uri": "https://a.org/a.png"}), "not lead into the folder"),
        (edit("images", 0, value={"uri": "file:///a.png"}), "not lead into the folder"),
        (edit("images", 0, value={"uri": "data:,abc"}), "only base64"),
        (edit("images", 0, value={"uri": "data:;base64,abc"}), "Incorrect padding"),
        (edit("images", 0, value={"bufferView": 0}), r"images\[0\] cannot be read as PNG"),
        (edit("images", 0, value={}), "is missing"),
        (edit("extensionsRequired", value=["KHR_draco_mesh_compression"]),
         "the extension KHR_draco_mesh_compression, which is not supported"),
        (edit("extensionsRequired", value=["EXT_meshopt_compression"]), "EXT_meshopt_compression"),
    ],
)  # fmt: skip
def test_trees_that_lie(tmp_path, change, match):
    file = quad(four_colours())
    change(file)
    assert_refused(file.write(tmp_path / "bad.glb"), match)


def test_numbers_too_large_for_floats(tmp_path):
    file = quad()
    file.tree["nodes"][0]["scale"] = [1, 77777, 1]
    path = tmp_path / "bad.glb"
    path.write_bytes(file.glb().replace(b"77777", b"1e400", 1))
    assert_refused(path, "not finite|trimesh cannot read it")


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_vertices_that_are_not_finite(tmp_path, wrong):
    file = Gltf()
    corners = CUBE.copy()
    corners[0, 1, 2] = wrong
    file.node(name="Mug", mesh=file.mesh(file.primitive(corners)))
    assert_refused(file.write(tmp_path / "bad.glb"), rf"node 0 \(Mug\): vertex 1 is .*{wrong}")


def test_triangles_with_missing_vertices(tmp_path):
    file = Gltf()
    indices = file.array(np.array([0, 1, 36], np.uint16))
    file.node(name="Mug", mesh=file.mesh(file.primitive(CUBE, indices=indices)))
    assert_refused(file.write(tmp_path / "bad.glb"), "Mug.*vertex 36 of 36")


def test_cycles_of_nodes(tmp_path):
    file = Gltf()
    mesh = file.mesh(file.primitive(CUBE))
    file.node(name="A", mesh=mesh)
    for child in (2, 3, 1):
        file.node(root=False, name="B", children=[child])
    assert_refused(file.write(tmp_path / "bad.glb"), "is in a cycle or below")
    file.tree["scenes"] = [{"nodes": [2]}]
    assert_refused(file.write(tmp_path / "bad.glb"), "is in a cycle or below")


def test_nodes_deep_below_each_other(tmp_path):
    file = Gltf()
    below = file.node(root=False, name="A", mesh=file.mesh(file.primitive(CUBE)))
    for _ in range(300):
        below = file.node(root=False, name="B", children=[below])
    file.tree["scenes"] = [{"nodes": [below]}]
    assert_refused(file.write(tmp_path / "bad.glb"), "below 200 others")


def test_file_without_names(tmp_path):
    file = Gltf()
    child = file.node(root=False, mesh=file.mesh(file.primitive(CUBE)))
    file.node(children=[child])
    assert_refused(file.write(tmp_path / "bad.glb"), "node 0 has a mesh, but neither")


def test_links_out_of_the_folder(tmp_path):
    (tmp_path / "secret.png").write_bytes(b"x")
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "link.png").symlink_to(tmp_path / "secret.png")
    file = quad(four_colours())
    file.tree["images"][0] = {"uri": "link.png"}
    assert_refused(file.write(tmp_path / "in" / "bad.glb"), "not lead into the folder")


def test_what_is_no_file(tmp_path):
    assert_refused(tmp_path / "none.glb", "does not exist", FileNotFoundError)
    (tmp_path / "folder.glb").mkdir()
    assert_refused(tmp_path / "folder.glb", "is not a file")
    file = quad(four_colours())
    file.tree["images"][0] = {"uri": "missing.png"}
    with pytest.raises(FileNotFoundError, match=r"missing\.png does not exist"):
        load_home(file.write(tmp_path / "a.glb"))


def test_limits(tmp_path, monkeypatch):
    path = quad(four_colours()).write(tmp_path / "large.glb")
    load_home(path)
    for module, name, value, match in (
        (gltf_file, "FILE_BYTES", 500, "larger than 500"),
        (gltf_file, "JSON_BYTES", 100, "JSON has .* more than 100"),
        (gltf_file, "NODES", 0, "1 nodes, more than 0"),
        (gltf_parts, "CORNERS", 11, "more than 11 vertices"),
        (gltf_colour, "TEXTURE_PX", 1, "2 x 2 pixels"),
        (gltf_colour, "ALL_TEXTURES_PX", 3, "over 3 pixels"),
    ):
        with monkeypatch.context() as limit:
            limit.setattr(module, name, value)
            assert_refused(path, match)


def test_one_mesh_at_many_nodes_counts_each_time(tmp_path, monkeypatch):
    file = Gltf()
    mesh = file.mesh(file.primitive(CUBE))
    for k in range(4):
        file.node(name=f"A{k}", mesh=mesh)
    monkeypatch.setattr(gltf_parts, "CORNERS", 4 * 72 - 1)
    assert_refused(file.write(tmp_path / "many.glb"), "vertices and corners")


def test_image_that_would_be_huge(tmp_path):
    """The size of an image is checked before its pixels are made."""
    file = io.BytesIO()
    Image.new("L", (8, 8)).save(file, "PNG")
    data = bytearray(file.getvalue())
    data[16:24] = struct.pack(">II", 60_000, 60_000)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    gltf = quad(four_colours())
    gltf.tree["images"][0] = {"bufferView": gltf.view(bytes(data))}
    assert_refused(gltf.write(tmp_path / "bomb.glb"), r"images\[0\]")


def test_gltf_is_not_glb(tmp_path):
    path = tmp_path / "alone.gltf"
    path.write_text(json.dumps(flat().tree | {"buffers": [{"byteLength": 4}]}))
    assert_refused(path, "is missing")
    path.write_bytes(glb(b"{}", b""))
    assert_refused(path, "asset.version is None")
