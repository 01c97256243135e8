"""The simulated detector of the benchmark of queries."""

import numpy as np
import pytest

from gslts.core.camera import camera_from_fov, look_at
from gslts.core.frame import Labels, RgbdFrame
from gslts_bench.queries.noisy_detector import FALSE, MISSED, WRONG, NoisyDetector

NAMES = ("Mug", "Sofa", "Bed", "Lamp")
IMAGES = 400


def frame() -> RgbdFrame:
    """Return a frame of a mug, of a mug that is too small, and of a wall."""
    instances = np.full((60, 80), 2, np.int32)
    instances[20:40, 30:60], instances[50:53, 5:8] = 0, 1
    camera = camera_from_fov(80, 60, 1.0, look_at((0, -1, 0), (0, 0, 0)))
    rgb, depth = np.zeros((60, 80, 3), np.uint8), np.ones((60, 80), np.float32)
    return RgbdFrame(rgb, depth, camera, labels=Labels(instances, ("Mug", "Mug", "Wall")))


@pytest.mark.parametrize("masks", [False, True])
def test_errors_have_their_shares(masks: bool) -> None:
    detector = NoisyDetector(NAMES, 0, masks=masks)
    detections = named = false = 0
    for _ in range(IMAGES):
        found = detector(frame())
        is_mug = np.abs(found.boxes - (30, 20, 60, 40)).max(axis=1, initial=0) < 8
        detections += np.count_nonzero(is_mug)
        named += np.count_nonzero(is_mug & (found.classes == 0))
        false += np.count_nonzero(~is_mug)
        assert (found.masks is not None) == masks
        if masks:
            assert len(found.masks) == len(found.boxes)
    assert detections == pytest.approx((1 - MISSED) * IMAGES, rel=0.1)
    assert false == pytest.approx(FALSE * IMAGES, rel=0.4)
    # A wrong name is one of the four, also the right one.
    assert named == pytest.approx((1 - WRONG * 3 / 4) * detections, rel=0.05)


def test_runs_with_one_seed_are_the_same() -> None:
    first, second = (NoisyDetector(NAMES, 5)(frame()) for _ in range(2))
    np.testing.assert_array_equal(first.boxes, second.boxes)
    np.testing.assert_array_equal(first.scores, second.scores)
