"""Variants of a finished map: half and double the Gaussians, and the next SH degree."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.config import MappingConfig
from gslts.mapping.density.control import split, total_weights
from gslts.mapping.density.merge import merge
from gslts.mapping.evaluation.evaluate import evaluate
from gslts.mapping.observation import Observation
from gslts.mapping.optimize import Optimizer, Schedule

MIN_GAIN_DB = 0.05
"""Validation PSNR that a higher SH degree must gain, dB: it multiplies the memory of the colours
by two to four."""
WEIGHT_POWER = 1.4
"""Exponent of the total blending weight as the cost of merging a Gaussian. Fitted: on maps from
thinned seeds 1 loses up to 0.1 dB; on other maps it makes no difference."""


@dataclass(frozen=True, eq=False)
class Variant:
    """A map after as many refinement steps as all other variants.

    Attributes:
        name: "chosen" for the map itself, "half", "double" or "SH degree 1".
        gaussian_map: After refinement.
        psnr_db: PSNR on the validation frames, dB.
    """

    name: str
    gaussian_map: GaussianMap
    psnr_db: float


def make_variants(
    gaussian_map: GaussianMap,
    observations: Sequence[Observation],
    validation: Sequence[Observation],
    config: MappingConfig,
) -> list[Variant]:
    """Refine a map, its half, its double and its next SH degree for the same number of steps.

    Args:
        gaussian_map: Finished map.
        observations: Training frames; they are not changed.
        validation: Validation frames, at refined poses.
        config: Settings, among them `variant_steps`.

    Returns:
        The map itself first.
    """
    changes: dict[str, Callable[[GaussianMap], GaussianMap]] = {
        "chosen": lambda old: old,
        "half": lambda old: merge_to(old, max(1, old.size // 2), observations, config.threads),
        "double": lambda old: split(old, np.arange(old.size)),
    }
    degree = gaussian_map.sh_degree + 1
    if degree <= config.max_sh_degree:
        changes[f"SH degree {degree}"] = lambda old: with_sh_degree(old, degree)
    variants = []
    for name, change in changes.items():
        changed = refine_map(change(gaussian_map), observations, config)
        quality = evaluate(changed, validation, config.threads)
        variants.append(Variant(name, changed, quality.psnr_db))
    return variants


def merge_to(
    gaussian_map: GaussianMap, count: int, observations: Sequence[Observation], threads: int = 0
) -> GaussianMap:
    """Merge Gaussians until a number is left, first where the training frames see least.

    Args:
        gaussian_map: float32.
        count: Number of Gaussians that are left, at least 1.
        observations: Training frames.
        threads: Number of threads; 0 means all.
    """
    weights = total_weights(gaussian_map, observations, threads)
    return merge(gaussian_map, count, weights**WEIGHT_POWER)


def choose_variant(variants: Sequence[Variant]) -> Variant:
    """Return the map itself, or the one of a higher SH degree if it gains `MIN_GAIN_DB`.

    Args:
        variants: See `make_variants`.
    """
    chosen = variants[0]
    for other in variants[1:]:
        higher = other.gaussian_map.sh_degree > chosen.gaussian_map.sh_degree
        if higher and other.psnr_db > chosen.psnr_db + MIN_GAIN_DB:
            chosen = other
    return chosen


def with_sh_degree(gaussian_map: GaussianMap, degree: int) -> GaussianMap:
    """Return a map of a higher SH degree that looks the same.

    Args:
        gaussian_map: Any map.
        degree: At least that of the map; new coefficients are 0.
    """
    sh = np.zeros((gaussian_map.size, (degree + 1) ** 2, 3), gaussian_map.dtype)
    sh[:, : gaussian_map.sh.shape[1]] = gaussian_map.sh
    return replace(gaussian_map, sh=sh)


def refine_map(
    gaussian_map: GaussianMap, observations: Sequence[Observation], config: MappingConfig
) -> GaussianMap:
    """Return a map after `variant_steps` steps at the final learning rates, poses fixed.

    Args:
        gaussian_map: float32.
        observations: Training frames; they are not changed.
        config: Settings of the map.
    """
    late = config.rates_left
    gentle = config.model_copy(
        update={
            "refine_poses": False,
            "refine_lenses": False,
            "growth": 0.0,
            "fill_holes": False,  # It would undo the change of the number.
            "means_rate": config.means_rate * config.means_left,
            "quats_rate": config.quats_rate * late,
            "log_scales_rate": config.log_scales_rate * late,
            "logit_opacities_rate": config.logit_opacities_rate * late,
            "sh_rate": config.sh_rate * late,
            "means_left": 1.0,
            "rates_left": 1.0,
        }
    )
    copies = [replace(observation) for observation in observations]
    schedule = Schedule(config.variant_steps, ((float("inf"), 0),))
    optimizer = Optimizer(gaussian_map, copies, copies[0].lenses, gentle, schedule)
    while optimizer.share < 1:
        optimizer.run_epoch(lambda _: None)
    return optimizer.adam.map
