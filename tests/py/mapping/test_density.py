"""Splitting of Gaussians during the optimization, and their weights in images."""

import numpy as np
import pytest
from striped_wall import grey_wall, half_striped

import gslts
from gslts.mapping.config import MappingConfig
from gslts.mapping.density.control import max_weights, split
from gslts.mapping.optimize import Optimizer, Schedule


def grown(growth: float, max_gaussians: int | None = None, steps: int = 60) -> gslts.GaussianMap:
    config = MappingConfig(
        growth=growth,
        max_gaussians=max_gaussians,
        voxel_m=0.1,
        refine_poses=False,
        refine_lenses=False,
    )
    observation = half_striped()
    schedule = Schedule(steps, ((float("inf"), 0),))
    optimizer = Optimizer(grey_wall(), [observation], observation.lenses, config, schedule)
    while optimizer.share < 1:
        optimizer.run_epoch(lambda _: None)
    return optimizer.adam.map


def test_gaussians_are_split_where_there_is_texture() -> None:
    start, end = grey_wall(), grown(1.0)
    assert end.size == pytest.approx(2 * start.size, rel=0.05)
    new = end.means[end.ids >= start.size]
    assert (new[:, 0] > -0.05).mean() > 0.8
    assert grown(0.0).size <= start.size


def test_an_epoch_beyond_the_end_of_the_growth_adds_no_more() -> None:
    # The second of two steps is from 50 to 100 % of the schedule, and Gaussians grow until 60 %.
    assert grown(1.0, steps=2).size == pytest.approx(2**0.2 * grey_wall().size, rel=0.01)


def test_the_maximum_number_is_kept() -> None:
    max_gaussians = grey_wall().size + 50
    assert grown(1.0, max_gaussians).size == max_gaussians


def test_halves_are_beside_the_centre_along_the_longest_axis() -> None:
    quarter_turn = [np.sqrt(0.5), 0, 0, np.sqrt(0.5)]  # About z: x becomes y.
    rng = np.random.default_rng(0)
    three = gslts.GaussianMap(
        means=np.array([[0.0, 0, 0], [1, 2, 3], [5, 5, 5]]),
        quats=3 * np.array([[1, 0, 0, 0], quarter_turn, [0, 0, 0, 1]]),
        log_scales=np.log(np.tile([0.4, 0.1, 0.2], (3, 1))),
        logit_opacities=np.arange(3.0),
        sh=rng.normal(size=(3, 4, 3)),
        features=rng.normal(size=(3, 2)),
        ids=np.array([5, 8, 6], np.uint64),
    )
    four = split(three, np.array([1]))
    np.testing.assert_allclose(
        four.means, [[0, 0, 0], [1, 2.28, 3], [5, 5, 5], [1, 1.72, 3]], atol=1e-12
    )
    narrow, wide = [0.25, 0.1, 0.2], [0.4, 0.1, 0.2]
    np.testing.assert_allclose(np.exp(four.log_scales), [wide, narrow, wide, narrow])
    assert four.ids.tolist() == [5, 8, 6, 9]
    for name in ("quats", "logit_opacities", "sh", "features"):
        old, new = getattr(three, name), getattr(four, name)
        np.testing.assert_array_equal(new, old[[0, 1, 2, 1]])


def test_hidden_gaussians_have_no_weight() -> None:
    three = gslts.GaussianMap(
        means=np.array([[0, 0, 0.5], [0, 0, 0.8], [0, 0, -1]]),
        quats=np.tile([1.0, 0, 0, 0], (3, 1)),
        log_scales=np.log([[0.2, 0.2, 0.02], [0.01, 0.01, 0.01], [0.1, 0.1, 0.1]]),
        logit_opacities=np.array([9.0, 9.0, 9.0]),
        sh=np.zeros((3, 1, 3)),
    ).astype(np.float32)
    weights = max_weights(three, [half_striped()])
    assert weights[0] > 0.95
    assert 0 < weights[1] < 0.05
    assert weights[2] == 0
