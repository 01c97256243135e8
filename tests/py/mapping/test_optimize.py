"""Pruning at the end of an epoch."""

import pytest
from striped_wall import grey_wall, half_striped

from gslts.mapping.config import MappingConfig
from gslts.mapping.optimize import Optimizer, Schedule


def optimizer_with(min_opacity: float) -> Optimizer:
    """Make an optimizer of a wall of opacity 0.8."""
    config = MappingConfig(voxel_m=0.1, min_opacity=min_opacity, refine_lenses=False, threads=1)
    observation = half_striped()
    schedule = Schedule(3, ((float("inf"), 0),))
    return Optimizer(grey_wall(), [observation], observation.lenses, config, schedule)


def test_pruning_all_gaussians_is_an_error() -> None:
    message = "every Gaussian was pruned: none is more opaque than min_opacity=0.99"
    with pytest.raises(ValueError, match=message):
        optimizer_with(0.99).run_epoch(lambda _: None)


@pytest.mark.filterwarnings("error")
def test_a_minimum_opacity_of_0_prunes_nothing() -> None:
    optimizer = optimizer_with(0.0)
    optimizer.run_epoch(lambda _: None)
    assert optimizer.adam.map.size >= grey_wall().size
