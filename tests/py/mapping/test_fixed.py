"""Optimization of a part of a map."""

import numpy as np
import store_maps
from striped_wall import grey_wall, half_striped

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.config import MappingConfig
from gslts.mapping.exposures import fold_mean_exposure
from gslts.mapping.optimize import Optimizer, Schedule
from gslts.rendering.losses import Exposure


def fitted(fixed: np.ndarray, threads: int = 1) -> GaussianMap:
    """Fit the grey wall to a striped one, with growth and refined poses."""
    config = MappingConfig(voxel_m=0.1, refine_lenses=False, threads=threads)
    observation = half_striped()
    schedule = Schedule(40, ((float("inf"), 0),))
    optimizer = Optimizer(grey_wall(), [observation], observation.lenses, config, schedule, fixed)
    while optimizer.share < 1:
        optimizer.run_epoch(lambda _: None)
    return optimizer.adam.map


def test_fixed_gaussians_stay_bit_by_bit_and_the_others_change() -> None:
    before = grey_wall()
    fixed = before.means[:, 0] < 0.5
    after = fitted(fixed)
    kept = after.select(np.isin(after.ids, before.ids[fixed]))
    store_maps.assert_same(kept, before.select(fixed))
    free = after.select(~np.isin(after.ids, before.ids[fixed]))
    assert free.size > (~fixed).sum()
    assert np.ptp(free.sh[:, 0, 0]) > 0.5
    assert free.means[:, 0].min() > 0.3


def test_number_of_threads_does_not_matter() -> None:
    fixed = grey_wall().means[:, 0] < 0.5
    store_maps.assert_same(fitted(fixed, 1), fitted(fixed, 3))


def test_loose_frames_get_the_given_mean_exposure() -> None:
    before = grey_wall()
    fixed = np.arange(before.size) < 10
    loose, known = half_striped(), half_striped()
    loose.exposure = Exposure(gain=(0.5, 0.5, 0.5), offset=(0.2, 0.2, 0.2))
    known.exposure, known.shows_known = Exposure(gain=(0.9, 0.9, 0.9)), True
    mean = Exposure(gain=(0.8, 0.8, 0.8), offset=(0.1, 0.1, 0.1))
    after = fold_mean_exposure(before, [loose, known], fixed, mean)
    np.testing.assert_allclose(loose.exposure.gain, 0.8)
    np.testing.assert_allclose(loose.exposure.offset, 0.1, atol=1e-12)
    np.testing.assert_allclose(known.exposure.gain, 0.9)
    assert np.array_equal(after.sh[:10], before.sh[:10])
    # What the frame shows is the same: 0.5 c + 0.2 before, 0.8 c' + 0.1 now, for the grey c = 0.5.
    colors = 0.5 + 0.28209479 * after.sh[10:, 0]
    np.testing.assert_allclose(0.8 * colors + 0.1, 0.5 * 0.5 + 0.2, atol=1e-6)
