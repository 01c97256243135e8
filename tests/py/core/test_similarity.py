"""Maps that are turned, scaled and moved."""

import numpy as np
import pytest
import scenes

import gslts
from gslts.core.se3 import product, rotation
from gslts.core.similarity import split_similarity, transform_map


def similarity(scale: float = 1.0) -> np.ndarray:
    transform = np.eye(4)
    transform[:3, :3] = scale * rotation(np.array([0.4, -1.1, 2.0]))
    transform[:3, 3] = [3, -2, 0.5]
    return transform


@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_what_is_turned_looks_the_same_from_a_turned_camera(scale: float) -> None:
    gaussian_map = scenes.random_map(300, sh_degree=3, origin=(0.1, 0, 0))
    camera = scenes.orbit_camera()
    pose = product(similarity(scale), camera.world_from_camera)
    pose[:3, :3] /= scale
    turned = gslts.Camera(
        **{name: getattr(camera, name) for name in ("width", "height", "fx", "fy", "cx", "cy")},
        world_from_camera=pose,
    )
    expected = gslts.render(gaussian_map, camera)
    images = gslts.render(transform_map(gaussian_map, similarity(scale)), turned)
    assert np.ptp(expected.rgb) > 0.5
    np.testing.assert_allclose(images.rgb, expected.rgb, atol=1e-6)
    np.testing.assert_allclose(images.depth, scale * expected.depth, atol=1e-6)


def test_a_translation_moves_the_origin_only() -> None:
    gaussian_map = scenes.random_map(5, sh_degree=1, dtype=np.float32, origin=(1, 2, 3))
    transform = np.eye(4)
    transform[:3, 3] = 1e6
    moved = transform_map(gaussian_map, transform)
    assert moved.means.tobytes() == gaussian_map.means.tobytes()
    assert moved.quats.tobytes() == gaussian_map.quats.tobytes()
    assert moved.origin.tolist() == [1e6 + 1, 1e6 + 2, 1e6 + 3]


@pytest.mark.parametrize(
    ("linear", "message"),
    [
        (np.diag([1.0, 1, -1]), "positive scale"),
        (np.zeros((3, 3)), "positive scale"),
        (np.diag([1.0, 1, np.nan]), "positive scale"),
        (np.diag([1.0, 1, 2]), "one scale for all axes"),
        (np.eye(3) + np.diag([0.1, 0], 1), "no shear"),
    ],
)
def test_what_gaussians_cannot_follow(linear: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        split_similarity(linear)
