"""`gslts._core.reloc.register_clouds` on a corner of a room; its rules are tested in C++."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gslts._core.reloc import CloudRule, Registration, register_clouds


def corner(count: int, seed: int) -> np.ndarray:
    """Return [count,3] float32 points of a floor and two walls of 2 m, with 3 mm noise."""
    random = np.random.default_rng(seed)
    points = random.uniform(0, 2, (count, 3))
    points[np.arange(count), random.integers(0, 3, count)] = 0
    return (points + random.normal(0, 0.003, points.shape)).astype(np.float32)


def motion() -> np.ndarray:
    """Return a motion [4,4] of 3 degrees and 5 cm."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec([1, -2, 2], degrees=True).as_matrix()
    matrix[:3, 3] = 0.03, 0.04, -0.01
    return matrix


def moved(points: np.ndarray, by: np.ndarray) -> np.ndarray:
    return (points @ by[:3, :3].T + by[:3, 3]).astype(np.float32)


def registered(source: np.ndarray, target: np.ndarray, guess: np.ndarray) -> Registration:
    return register_clouds(source, target, guess, rule=CloudRule())


@pytest.mark.parametrize("start", ["from afar", "from there"])
def test_a_corner_is_registered_with_itself(start: str) -> None:
    expected = motion()
    guess = np.eye(4) if start == "from afar" else expected
    found = registered(corner(4000, 1), moved(corner(6000, 2), expected), guess)
    assert found.converged
    assert found.overlap > 0.99
    assert 0 < found.rms_m < 0.01
    assert found.target_from_source.shape == (4, 4)
    assert found.target_from_source.dtype == np.float64
    middle = np.array([1, 1, 1, 1])
    assert np.linalg.norm((found.target_from_source - expected) @ middle) < 0.003
    turn = Rotation.from_matrix(expected[:3, :3].T @ found.target_from_source[:3, :3])
    assert np.degrees(turn.magnitude()) < 0.2


def test_with_few_points_the_guess_is_returned() -> None:
    few = np.zeros((0, 3), np.float32)
    found = registered(few, corner(100, 1), motion())
    assert (found.converged, found.overlap, found.rms_m) == (False, 0, 0)
    np.testing.assert_array_equal(found.target_from_source, motion())


def test_a_rule_keeps_its_settings() -> None:
    rule = CloudRule(voxel_m=0.1, max_distance_m=0.3, neighbours=8, iterations=5)
    assert (rule.voxel_m, rule.max_distance_m) == (0.1, 0.3)
    assert (rule.neighbours, rule.iterations) == (8, 5)
    with pytest.raises(TypeError):
        CloudRule(0.1)
    with pytest.raises(TypeError):
        CloudRule(neighbours=8.0)


def test_wrong_arguments_are_named() -> None:
    points = corner(100, 1)
    with pytest.raises(ValueError, match=r"source: expected .* float32 .*\(\*, 3\), got float64"):
        registered(points.astype(np.float64), points, np.eye(4))
    with pytest.raises(ValueError, match=r"target: expected .* got float32 \(100, 2\)"):
        registered(points, np.ascontiguousarray(points[:, :2]), np.eye(4))
    with pytest.raises(ValueError, match=r"guess: expected .* got float64 \(3, 4\)"):
        registered(points, points, np.eye(4)[:3])
    with pytest.raises(ValueError, match="guess must be a finite rigid motion"):
        registered(points, points, np.diag([2.0, 1, 1, 1]))
    points[7, 1] = np.nan
    with pytest.raises(ValueError, match=r"register_clouds: source\[7\] is not finite"):
        registered(points, corner(100, 1), np.eye(4))
    with pytest.raises(ValueError, match="voxel_m must be in"):
        register_clouds(points, points, np.eye(4), rule=CloudRule(voxel_m=-1))
