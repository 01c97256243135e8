"""Tests of shapes: closed, outward, of the right size, with textures in metres."""

from collections import Counter

import numpy as np
import pytest
from home_checks import signed_volume

from gslts_sim.procedural.mesh import Mesh, join
from gslts_sim.procedural.shapes import (
    box,
    cushion,
    cylinder,
    disc,
    ellipsoid,
    lathe,
    leaf,
    prism,
    sheet,
    tube,
)

SHAPES = {
    "box": (box(0.4, 0.3, 0.2), 0.4 * 0.3 * 0.2),
    "cushion": (cushion(0.4, 0.3, 0.2, 0.001), 0.4 * 0.3 * 0.2),
    "stuffed": (cushion(0.4, 0.3, 0.2, 0.05, 0.5), None),
    "ball": (cushion(0.2, 0.2, 0.2, 0.1, steps=12), np.pi / 6 * 0.2**3),
    "cylinder": (cylinder(0.1, 0.3, n=96), np.pi * 0.1**2 * 0.3),
    "cone": (cylinder(0.1, 0.3, 0, n=96), np.pi * 0.1**2 * 0.1),
    "ellipsoid": (ellipsoid(0.4, 0.3, 0.2, 64), np.pi / 6 * 0.4 * 0.3 * 0.2),
    "cup": (lathe([(0, 0), (0.1, 0), (0.1, 0.2), (0.09, 0.2), (0.09, 0.01), (0, 0.01)], 96), None),
    "tube": (tube([(0, 0, 0), (0, 0, 0.5), (0.2, 0, 0.9)], 0.02), None),
    "sheet": (sheet([(0, 0), (0.5, 0.1), (1, 0)], 0.01, 2.0), 0.02),
    "prism": (prism([(0, 0), (0.4, 0), (0.4, 0.2)], 0.5), 0.5 * 0.4 * 0.2 * 0.5),
    "leaf": (leaf(0.2, 0.06, 0.8), None),
}


@pytest.mark.parametrize("name", SHAPES)
def test_closed_and_outward(name):
    mesh, volume = SHAPES[name]
    keys = np.round(mesh.vertices, 7)
    welded = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)[mesh.faces]
    edges = Counter((int(face[k]), int(face[(k + 1) % 3])) for face in welded for k in range(3))
    assert all(edges[b, a] == count for (a, b), count in edges.items())
    assert signed_volume(mesh.vertices, mesh.faces) > 0
    if volume is not None:
        assert signed_volume(mesh.vertices, mesh.faces) == pytest.approx(volume, rel=0.01)


@pytest.mark.parametrize("name", SHAPES)
def test_texture_is_in_metres(name):
    mesh, _ = SHAPES[name]
    assert mesh.uvs_m.shape == (len(mesh.faces), 3, 2)
    assert np.isfinite(mesh.uvs_m).all()
    corners = mesh.vertices[mesh.faces]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    across = np.linalg.norm(mesh.uvs_m - np.roll(mesh.uvs_m, 1, axis=1), axis=2)
    # Projection shortens slanted sides, and surfaces of revolution stretch near their axis.
    assert across.max() <= edges.max() * 4


def test_a_print_is_upright_on_the_front_of_a_box():
    mesh = box(0.4, 0.1, 0.2, upright=True)
    corners = mesh.vertices[mesh.faces]
    front = (corners[:, :, 1] == -0.05).all(axis=1)
    assert front.sum() == 2
    for at, uv in zip(corners[front].reshape(-1, 3), mesh.uvs_m[front].reshape(-1, 2), strict=True):
        np.testing.assert_allclose(uv, [at[0] + 0.2, 0.2 - at[2]], atol=1e-12)


def test_grain_runs_along_the_longest_edge():
    mesh = box(0.05, 0.05, 0.7)
    assert np.ptp(mesh.uvs_m[:, :, 0]) == pytest.approx(0.7)


def test_a_disc_faces_up():
    corners = disc(0.1).vertices[disc(0.1).faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()


def test_moving_turning_and_joining():
    post = box(0.1, 0.1, 1)
    lying = post.rotate("y", np.pi / 2)
    np.testing.assert_allclose(np.ptp(lying.vertices, axis=0), [1, 0.1, 0.1], atol=1e-12)
    both: Mesh = join([post, lying.translate(z=2)])
    assert len(both.faces) == 24
    assert both.vertices[:, 2].max() == pytest.approx(2.05)
