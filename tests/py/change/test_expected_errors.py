"""Noise of the depth and expected errors of the map in change detection."""

import numpy as np
import pytest
from change_images import CAMERA, HEIGHT, WALL_M, WIDTH, blank, put

from gslts._core import detect as core
from gslts._core.detect import MaskRule, ObjectRule

STEP_M = 0.05


def surfaces(**known: object) -> list[core.Surface]:
    """Find the surfaces where a box of 5 cm came, with what is known of the map."""
    images = blank()
    put(images, "after", (40, 60), depth_m=WALL_M - STEP_M, color=(0.5, 0.5, 0.5))
    views = core.Views(camera=CAMERA, **images, **known)
    masks = core.compute_masks(views, MaskRule())
    return core.find_changed_surfaces(views, masks, ObjectRule())[0]


@pytest.mark.parametrize("per_m", [0.0, 0.002])
def test_a_step_counts_from_three_sigmas_on(per_m: float) -> None:
    depth_m = WALL_M - STEP_M
    limit_m = STEP_M / ObjectRule().step_sigmas - per_m * depth_m**2
    assert len(surfaces(noise=(0.9 * limit_m, per_m))) == 1
    assert len(surfaces(noise=(1.1 * limit_m, per_m))) == 0
    (found,) = surfaces(noise=(0.5 * limit_m, per_m))
    expected = STEP_M / (ObjectRule().step_sigmas * (0.5 * limit_m + per_m * depth_m**2))
    assert found.evidence.step_ratio == pytest.approx(expected, rel=1e-3)


def test_errors_are_means_over_the_surface() -> None:
    depth_error = np.full((HEIGHT, WIDTH), 0.1, np.float32)
    color_error = np.full((HEIGHT, WIDTH), 0.9, np.float32)
    depth_error[40:64, 60:80] = 0.01
    color_error[40:64, 60:70], color_error[40:64, 70:80] = 0.2, 0.4
    (found,) = surfaces(noise=(0.005, 0.0), depth_error=depth_error, color_error=color_error)
    assert found.evidence.depth_error_m == pytest.approx(0.01, rel=0.05)
    assert found.evidence.color_error == pytest.approx(0.3, rel=0.05)
    features = core.confidence_features(found)
    assert features[16] == pytest.approx(np.log(found.evidence.depth_error_m + 0.003))
    assert features[17] == pytest.approx(np.log(found.evidence.color_error + 0.02))


def test_without_errors_typical_ones_count() -> None:
    (found,) = surfaces(noise=(0.005, 0.0))
    assert found.evidence.depth_error_m == core.Evidence().depth_error_m
    assert found.evidence.color_error == core.Evidence().color_error


def test_errors_of_another_size_are_rejected() -> None:
    with pytest.raises(ValueError, match="depth_error: expected a C-contiguous float32 array"):
        surfaces(depth_error=np.zeros((2, 2), np.float32))
