"""Tests of colours and textures of glTF files."""

import base64
import json
from dataclasses import replace

import numpy as np
import pytest
from gltf_files import QUAD_UV, four_colours, only_object, quad
from PIL import Image

from gslts.core.camera import camera_from_fov, look_at
from gslts_sim import load_home
from gslts_sim.raycast import RayCaster
from gslts_sim.texture_atlas import LINEAR_OF_BYTE, srgb_from_linear


def test_textures_are_upright(tmp_path):
    large = four_colours().resize((32, 32), Image.Resampling.NEAREST)
    home = load_home(quad(large).write(tmp_path / "a.glb"))
    home = replace(home, lights=(), ambient=np.ones(3))
    # glTF's front is our -y side.
    camera = camera_from_fov(64, 64, 0.8, look_at((0.5, -1.4, 0.5), (0.5, 0, 0.5)))
    radiance = RayCaster(home).render(camera).radiance
    seen = radiance[[16, 16, 48, 48], [16, 48, 16, 48]]
    expected = LINEAR_OF_BYTE[np.asarray(four_colours()).reshape(4, 3)]
    np.testing.assert_allclose(seen, expected, atol=0.05)


def test_texture_bytes_and_coordinates_are_untouched(tmp_path):
    surface = only_object(tmp_path, quad(four_colours(), 2.5 * QUAD_UV)).surfaces[0]
    np.testing.assert_array_equal(surface.texture, np.asarray(four_colours()))
    np.testing.assert_array_equal(surface.uvs.reshape(-1, 2), 2.5 * QUAD_UV)


def test_factor_is_multiplied_in_linear_light(tmp_path):
    factor = np.array([0.5, 0.25, 1.0])
    texture = (
        only_object(tmp_path, quad(four_colours(), baseColorFactor=[*factor, 0.3]))
        .surfaces[0]
        .texture
    )
    linear = LINEAR_OF_BYTE[np.asarray(four_colours())] * factor
    np.testing.assert_array_equal(texture, np.rint(255 * srgb_from_linear(linear)))
    assert texture[0, 0, 0] == 188  # Half the light of 255 in sRGB.


def test_factor_without_a_texture_is_the_colour(tmp_path):
    texture = only_object(tmp_path, quad(baseColorFactor=[0.2158605, 1, 0, 1])).surfaces[0].texture
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
    texture = only_object(tmp_path, quad(image)).surfaces[0].texture
    np.testing.assert_array_equal(texture, np.repeat(np.array(expected)[..., None], 3, axis=2))


def test_palette_with_opacity(tmp_path):
    image = four_colours().quantize(4)
    image.info["transparency"] = bytes([0, 128, 255, 255])
    texture = only_object(tmp_path, quad(image)).surfaces[0].texture
    np.testing.assert_array_equal(texture, np.asarray(four_colours()))


def test_transform_of_textures(tmp_path):
    # The quadrant at the lower left, turned by 90 degrees: the example of the extension.
    change = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5], "texCoord": 1}
    file = quad(four_colours(), baseColorTexture={"extensions": {"KHR_texture_transform": change}})
    attributes = file.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes["TEXCOORD_1"], attributes["TEXCOORD_0"] = attributes["TEXCOORD_0"], 0
    uvs = only_object(tmp_path, file).surfaces[0].uvs.reshape(-1, 2)
    np.testing.assert_allclose(uvs.min(axis=0), [0, 0.5], atol=1e-6)
    np.testing.assert_allclose(uvs.max(axis=0), [0.5, 1], atol=1e-6)
    np.testing.assert_allclose(uvs[1], [0.5, 0.5], atol=1e-6)  # From (1, 1).


def test_colours_at_vertices(tmp_path):
    file = quad(baseColorFactor=[1, 0.5, 1, 1])
    colours = np.array([[1, 1, 0]] * 3 + [[0, 0, 1]] * 3, np.float32)
    primitive = file.tree["meshes"][0]["primitives"][0]
    primitive["attributes"]["COLOR_0"] = file.array(colours)
    surface = only_object(tmp_path, file).surfaces[0]
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
