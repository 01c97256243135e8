"""`gslts._core.reloc`: features, landmarks and hypotheses; their rules are tested in C++."""

from typing import Any

import numpy as np
import pytest

from gslts._core import reloc
from gslts._core.reloc import FeatureRule, HypothesisRule, LandmarkIndex
from gslts.core.camera import Camera, camera_from_fov, look_at

TRUTH = look_at(np.array([0.3, -0.2, 1.4]), np.array([3.0, 0.4, 1.1]))
CAMERA = camera_from_fov(640, 480, 1.2)


def gray_texture(seed: int = 0) -> np.ndarray:
    """Return [240,320] uint8 squares of 16 px."""
    random = np.random.default_rng(seed)
    return np.kron(random.integers(0, 256, (15, 20)), np.ones((16, 16))).astype(np.uint8)


def landmarks(count: int = 800) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, descriptors and keyframes in front of the camera at TRUTH."""
    random = np.random.default_rng(1)
    positions = (3, 0, 1) + random.uniform(-1, 1, (count, 3)) * (2, 2, 1.2)
    descriptors = random.integers(0, 256, (count, 32))
    keyframes = random.integers(0, 5, count)
    return positions.astype(np.float32), descriptors.astype(np.uint8), keyframes.astype(np.int32)


def seen() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return pixels, descriptors and depths of the landmarks visible from TRUTH."""
    positions, descriptors, _ = landmarks()
    x, y, z = ((positions - TRUTH[:3, 3]) @ TRUTH[:3, :3]).T
    pixels = np.stack([CAMERA.fx * x / z + CAMERA.cx, CAMERA.fy * y / z + CAMERA.cy], axis=1)
    inside = (z > 0.3) & (pixels > 0).all(axis=1) & (pixels < (640, 480)).all(axis=1)
    return (
        pixels[inside].astype(np.float32),
        descriptors[inside],
        z[inside].astype(np.float32),
    )


def test_features_have_pixels_and_descriptors() -> None:
    pixels, descriptors = reloc.features_of(gray_texture(), None, FeatureRule(count=120))
    assert pixels.shape == (120, 2)
    assert pixels.dtype == np.float32
    assert descriptors.shape == (120, 32)
    assert descriptors.dtype == np.uint8
    assert (pixels > 19).all()
    assert (pixels < (301, 221)).all()
    # All keypoints are near corners of the squares.
    assert np.median(np.abs(pixels - 16 * np.round(pixels / 16))) < 2


def test_features_lie_inside_the_mask() -> None:
    mask = np.zeros((240, 320), bool)
    assert len(reloc.features_of(gray_texture(), mask, FeatureRule())[0]) == 0
    mask[:, :160] = True
    pixels, descriptors = reloc.features_of(gray_texture(), mask, FeatureRule())
    assert len(pixels) == len(descriptors) > 50
    assert pixels[:, 0].max() < 160
    everywhere = reloc.features_of(gray_texture(), ~np.zeros_like(mask), FeatureRule())
    unmasked = reloc.features_of(gray_texture(), None, FeatureRule())
    for masked, expected in zip(everywhere, unmasked, strict=True):
        np.testing.assert_array_equal(masked, expected)


def test_landmarks_are_found_by_their_descriptors() -> None:
    positions, descriptors, keyframes = landmarks()
    index = LandmarkIndex(positions, descriptors, keyframes)
    assert len(index) == 800
    rows, distances = index.match(descriptors[100:200], 3)
    assert rows.shape == distances.shape == (100, 3)
    assert rows.dtype == distances.dtype == np.int32
    np.testing.assert_array_equal(rows[:, 0], np.arange(100, 200))
    assert (distances[:, 0] == 0).all()
    found = rows[:, 1] >= 0
    bits = np.unpackbits(descriptors[100:200] ^ descriptors[rows[:, 1]], axis=1).sum(axis=1)
    np.testing.assert_array_equal(distances[found, 1], bits[found])
    assert (distances[~found, 1] == 256).all()


@pytest.mark.parametrize("depth", [True, False])
def test_the_true_pose_is_found(depth: bool) -> None:
    pixels, descriptors, depths = seen()
    index = LandmarkIndex(*landmarks())
    measured = depths if depth else np.full_like(depths, np.nan)
    found = reloc.hypotheses_of(CAMERA, pixels, descriptors, measured, index, HypothesisRule())
    assert len(found) == 1
    pose = found[0].world_from_camera
    assert pose.shape == (4, 4)
    assert pose.dtype == np.float64
    np.testing.assert_allclose(pose, TRUTH, atol=1e-4)
    assert found[0].inliers >= 0.98 * len(pixels)
    assert -1 <= found[0].keyframe < 5


def test_the_pose_of_the_camera_is_not_used() -> None:
    index = LandmarkIndex(*landmarks())
    moved = Camera(
        fx=CAMERA.fx,
        fy=CAMERA.fy,
        cx=CAMERA.cx,
        cy=CAMERA.cy,
        width=640,
        height=480,
        world_from_camera=look_at(np.zeros(3), np.ones(3)),
    )
    first, second = (
        reloc.hypotheses_of(camera, *seen(), index, HypothesisRule()) for camera in (CAMERA, moved)
    )
    np.testing.assert_array_equal(first[0].world_from_camera, second[0].world_from_camera)


def test_nothing_is_found_in_an_empty_map() -> None:
    index = LandmarkIndex(*(array[:0] for array in landmarks()))
    assert len(index) == 0
    rows, distances = index.match(landmarks()[1], 2)
    assert (rows == -1).all()
    assert (distances == 256).all()
    assert reloc.hypotheses_of(CAMERA, *seen(), index, HypothesisRule()) == []
    nothing = (array[:0] for array in seen())
    index = LandmarkIndex(*landmarks())
    assert reloc.hypotheses_of(CAMERA, *nothing, index, HypothesisRule()) == []


@pytest.mark.parametrize(
    ("rule", "settings"),
    [
        (FeatureRule, {"count": 7, "scale_step": 1.5, "levels": 3, "fast_threshold": 21}),
        (
            HypothesisRule,
            {
                "neighbours": 3,
                "max_bits": 50,
                "ratio": 0.7,
                "same_landmark_m": 0.2,
                "keyframes": 4,
                "inlier_px": 2.5,
                "inlier_depth": 0.1,
                "min_inliers": 12,
                "iterations": 99,
            },
        ),
    ],
)
def test_rules_keep_their_settings(rule: Any, settings: dict[str, float]) -> None:
    made = rule(**settings)
    assert {name: getattr(made, name) for name in settings} == settings
    with pytest.raises(TypeError):
        rule(*settings.values())
    for name in settings:
        with pytest.raises(AttributeError):
            setattr(made, name, 1)


def test_wrong_arrays_are_rejected() -> None:
    grey = gray_texture()
    with pytest.raises(ValueError, match="grey: expected a C-contiguous uint8"):
        reloc.features_of(grey.astype(np.float32), None, FeatureRule())
    with pytest.raises(ValueError, match="grey"):
        reloc.features_of(grey[:, ::2], None, FeatureRule())
    with pytest.raises(ValueError, match=r"mask: .* bool array of shape \(240, 320\)"):
        reloc.features_of(grey, np.ones((240, 319), bool), FeatureRule())
    with pytest.raises(ValueError, match=r"rule\.count must be positive, got 0"):
        reloc.features_of(grey, None, FeatureRule(count=0))
    positions, descriptors, keyframes = landmarks()
    with pytest.raises(ValueError, match=r"descriptors: .* shape \(800, 32\)"):
        LandmarkIndex(positions, descriptors[1:], keyframes)
    with pytest.raises(ValueError, match=r"keyframes: .* int32"):
        LandmarkIndex(positions, descriptors, keyframes.astype(np.int64))
    with pytest.raises(ValueError, match=r"positions\[0\] is not finite"):
        LandmarkIndex(np.full_like(positions, np.nan), descriptors, keyframes)
    index = LandmarkIndex(positions, descriptors, keyframes)
    for k in (0, 17):
        with pytest.raises(ValueError, match=f"k must be in 1..16, got {k}"):
            index.match(descriptors, k)
    pixels, seen_descriptors, depths = seen()
    rule = HypothesisRule()
    with pytest.raises(ValueError, match="pixels: expected"):
        reloc.hypotheses_of(CAMERA, pixels[1:], seen_descriptors, depths, index, rule)
    with pytest.raises(ValueError, match="depths: expected"):
        reloc.hypotheses_of(CAMERA, pixels, seen_descriptors, depths[1:], index, rule)
    with pytest.raises(ValueError, match=r"features\.pixels must be finite, got nan"):
        reloc.hypotheses_of(
            CAMERA, np.full_like(pixels, np.nan), seen_descriptors, depths, index, rule
        )
    with pytest.raises(ValueError, match=r"rule\.min_inliers must be at least 4, got 3"):
        reloc.hypotheses_of(
            CAMERA, pixels, seen_descriptors, depths, index, HypothesisRule(min_inliers=3)
        )
