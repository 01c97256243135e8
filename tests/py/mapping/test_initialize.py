"""Uncertainty of the given poses, as the rough poses show it."""

import numpy as np
import pytest
from striped_wall import grey_wall, half_striped

from gslts.core.se3 import se3_retract
from gslts.mapping.config import MappingConfig
from gslts.mapping.gauge import restore_gauge
from gslts.mapping.initialize import MIN_POSE_STD_M, MIN_POSE_STD_RAD, _pose_stds
from gslts.mapping.observation import Observation

CONFIG = MappingConfig()


def observations(std_m: float) -> list[Observation]:
    """Frames whose refined poses differ from the given ones."""
    rng = np.random.default_rng(0)
    frames = [half_striped() for _ in range(40)]
    for frame in frames:
        twist = np.concatenate([rng.normal(0, std_m, 3), rng.normal(0, 0.01 * std_m, 3)])
        frame.world_from_camera = se3_retract(frame.given_pose, twist)
    return frames


@pytest.mark.parametrize("moved", [False, True])
def test_poses_that_nothing_refined_keep_their_prior(moved: bool) -> None:
    """The first epoch refines no pose, but moves all to where they were: errors of rounding."""
    frames = observations(0)
    if moved:
        restore_gauge(grey_wall(), frames)
    assert _pose_stds(frames, CONFIG) == (CONFIG.pose_std_m, CONFIG.pose_std_rad)


def test_poses_that_were_refined_tell_their_prior() -> None:
    stds = _pose_stds(observations(0.02), CONFIG)
    assert 0.004 < stds[0] < 0.008, "errors of 12 frames average out"
    assert stds[1] == MIN_POSE_STD_RAD
    assert _pose_stds(observations(1e-5), CONFIG) == (MIN_POSE_STD_M, MIN_POSE_STD_RAD)
    assert _pose_stds(observations(1.0), CONFIG)[0] == CONFIG.pose_std_m
