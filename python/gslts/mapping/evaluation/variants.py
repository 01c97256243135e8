"""Whether a map has too many Gaussians or too few: what others would give after the same work."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.config import MappingConfig
from gslts.mapping.density.control import split, total_weights
from gslts.mapping.density.merge import merged
from gslts.mapping.evaluation.evaluate import evaluate
from gslts.mapping.observation import Observation
from gslts.mapping.optimize import Optimizer, Schedule

LEAST_GAIN_DB = 0.05
"""A higher SH degree must lower the error by as much to be worth three times the numbers."""
EMPHASIS = 1.4
"""Power of the pixels in which a Gaussian is seen, as its weight in merging, found by trial: of
maps from thinned seeds, 1 loses up to 0.1 dB more; of others, it makes no difference."""


@dataclass(frozen=True, eq=False)
class Variant:
    """A map, refined for as many steps as all others.

    Attributes:
        name: Such as "half".
        gaussian_map: After refinement.
        psnr_db: Of the frames kept aside.
    """

    name: str
    gaussian_map: GaussianMap
    psnr_db: float


def variants_of(
    gaussian_map: GaussianMap,
    observations: Sequence[Observation],
    held_out: Sequence[Observation],
    config: MappingConfig,
) -> list[Variant]:
    """The map itself ("chosen"), merged to half, split to double, and of the next SH degree.

    Args:
        gaussian_map: A finished map.
        observations: To refine with; they stay as they are.
        held_out: To judge by, at good poses.
        config: Its `variant_steps` are done for each.
    """
    changes: dict[str, Callable[[GaussianMap], GaussianMap]] = {
        "chosen": lambda old: old,
        "half": lambda old: fewer(old, max(1, old.size // 2), observations, config.threads),
        "double": lambda old: split(old, np.arange(old.size)),
    }
    degree = gaussian_map.sh_degree + 1
    if degree <= config.max_sh_degree:
        changes[f"SH degree {degree}"] = lambda old: with_sh_degree(old, degree)
    variants = []
    for name, change in changes.items():
        changed = refined(change(gaussian_map), observations, config)
        quality = evaluate(changed, held_out, config.threads)
        variants.append(Variant(name, changed, quality.psnr_db))
    return variants


def fewer(
    gaussian_map: GaussianMap, count: int, observations: Sequence[Observation], threads: int = 0
) -> GaussianMap:
    """Neighbours are merged until so many are left, first where the observations see least."""
    weights = total_weights(gaussian_map, observations, threads)
    return merged(gaussian_map, count, weights**EMPHASIS)


def chosen_of(variants: Sequence[Variant]) -> Variant:
    """The map itself, or the one of a higher SH degree if that lowers the error."""
    chosen = variants[0]
    for other in variants[1:]:
        higher = other.gaussian_map.sh_degree > chosen.gaussian_map.sh_degree
        if higher and other.psnr_db > chosen.psnr_db + LEAST_GAIN_DB:
            chosen = other
    return chosen


def with_sh_degree(gaussian_map: GaussianMap, degree: int) -> GaussianMap:
    """The same look with room for more harmonics, which are 0."""
    sh = np.zeros((gaussian_map.size, (degree + 1) ** 2, 3), gaussian_map.dtype)
    sh[:, : gaussian_map.sh.shape[1]] = gaussian_map.sh
    return replace(gaussian_map, sh=sh)


def refined(
    gaussian_map: GaussianMap, observations: Sequence[Observation], config: MappingConfig
) -> GaussianMap:
    """After `variant_steps` with the rates of the end of the schedule; poses are fixed."""
    late = config.rates_left
    gentle = config.model_copy(
        update={
            "refine_poses": False,
            "refine_lenses": False,
            "growth": 0.0,
            "fill_holes": False,  # They would give back what was taken.
            "means_rate": config.means_rate * config.means_left,
            "quats_rate": config.quats_rate * late,
            "log_scales_rate": config.log_scales_rate * late,
            "logit_opacities_rate": config.logit_opacities_rate * late,
            "sh_rate": config.sh_rate * late,
            "means_left": 1.0,
            "rates_left": 1.0,
        }
    )
    copies = [replace(one) for one in observations]
    schedule = Schedule(config.variant_steps, ((float("inf"), 0),))
    optimizer = Optimizer(gaussian_map, copies, copies[0].lenses, gentle, schedule)
    while optimizer.share < 1:
        optimizer.run_epoch(lambda _: None)
    return optimizer.adam.map
