"""Refinement of an edited map: fits Gaussians near a change to pixels near the change.

Source: GS-LTS, sec. III-D, post-training.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.adam import Adam, AdamRates
from gslts.rendering.losses import depth_loss, photometric_loss
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Bools
from gslts.update.config import RefineConfig
from gslts.update.targets import Target

OnStep = Callable[[int, Callable[[], GaussianMap]], None]
"""Called with the number of steps done, and a function that returns the map as it is then."""

PARAMETERS = ("means", "quats", "log_scales", "logit_opacities", "sh")
"""Arrays of the Gaussians that the refinement writes back."""
SH_REST_DIVISOR = 20
"""Learning rate of the base colour over that of the higher harmonics, as in 3DGS (Kerbl et al.
2023)."""


@dataclass(frozen=True, eq=False)
class Refinement:
    """Result of a refinement.

    Attributes:
        gaussian_map: Refined map; all Gaussians but the active ones are bit-identical.
        iterations: Number of steps.
        losses: Mean loss of each complete round of the targets.
    """

    gaussian_map: GaussianMap
    iterations: int
    losses: tuple[float, ...]


def refine(
    gaussian_map: GaussianMap,
    targets: Sequence[Target],
    active: Bools,
    config: RefineConfig,
    *,
    threads: int = 0,
    on_step: OnStep = lambda *_: None,
) -> Refinement:
    """Fit some Gaussians to targets. The result does not depend on the number of threads.

    Args:
        gaussian_map: float32.
        targets: From `view_targets` and `replay_targets`.
        active: [N] bool, Gaussians that may change.
        config: Settings.
        threads: 0 uses all hardware threads.
        on_step: Called after each step.

    Returns:
        The refined map.
    """
    if len(targets) == 0 or not active.any():
        return Refinement(gaussian_map, 0, ())
    fit = _Fit(gaussian_map, targets, active, config, threads)
    rng = np.random.default_rng(config.seed)
    losses: list[float] = []
    one_round = np.repeat(np.arange(len(targets)), [target.visits for target in targets])
    for step in range(config.iterations):
        position = step % len(one_round)
        if position == 0:
            if _has_converged(_round_means(losses, len(one_round)), config):
                break
            order = rng.permutation(one_round)
        background = rng.random(3).tolist()
        losses.append(fit.step(targets[order[position]], step / config.iterations, background))
        on_step(step + 1, fit.current_map)
    if not losses:
        return Refinement(gaussian_map, 0, ())
    return Refinement(fit.current_map(), len(losses), tuple(_round_means(losses, len(one_round))))


class _Fit:
    """Optimization of the Gaussians that the targets show."""

    def __init__(
        self,
        gaussian_map: GaussianMap,
        targets: Sequence[Target],
        active: Bools,
        config: RefineConfig,
        threads: int,
    ) -> None:
        self._whole, self._config, self._threads = gaussian_map, config, threads
        self._rasterizer = Rasterizer(np.float32)
        self._rows = np.flatnonzero(_visible(gaussian_map, targets, threads) | active)
        self._active = active[self._rows]
        self._adam = Adam(gaussian_map.select(self._rows).without_features())

    def step(self, target: Target, progress: float, background: list[float]) -> float:
        """Do one step at a progress from 0 to 1, and return the loss of the colours before it."""
        config, threads = self._config, self._threads
        # A random background: otherwise, missing Gaussians could pass for dark ones.
        options = RenderOptions(far_m=target.range_m, threads=threads, background=background)
        images = self._rasterizer.forward(self._adam.map, target.camera, options, mask=target.mask)
        color = photometric_loss(
            images.rgb,
            target.colors,
            mask=target.mask,
            dssim_weight=config.dssim_weight,
            exposure=target.exposure,
            threads=threads,
        )
        depth = depth_loss(
            images.depth, target.depth, mask=target.mask, relative=True, threads=threads
        )
        gradients = self._rasterizer.backward(
            dL_drgb=color.dL_drgb, dL_ddepth=depth.dL_ddepth * np.float32(config.depth_weight)
        )
        gradients = gradients.select(self._active)
        self._adam.step(gradients, _learning_rates(config, progress), threads=threads)
        return color.value

    def current_map(self) -> GaussianMap:
        """Return the whole map as it is now."""
        rows = self._rows[self._active]
        arrays = {}
        for name in PARAMETERS:
            array = getattr(self._whole, name).copy()
            array[rows] = getattr(self._adam.map, name)[self._active]
            arrays[name] = array
        return replace(self._whole, **arrays)


def _visible(gaussian_map: GaussianMap, targets: Iterable[Target], threads: int) -> Bools:
    """Return [N] Gaussians that contribute to the compared pixels."""
    rasterizer, plain = Rasterizer(np.float32), gaussian_map.without_features()
    visible = np.zeros(gaussian_map.size, np.bool_)
    for target in targets:
        options = RenderOptions(far_m=target.range_m, threads=threads)
        images = rasterizer.forward(plain, target.camera, options, mask=target.mask)
        visible[rasterizer.backward(dL_dalpha=np.zeros_like(images.alpha)).rows] = True
    return visible


def _learning_rates(config: RefineConfig, progress: float) -> AdamRates:
    """Return the learning rates, which decay exponentially."""
    decay = config.final_rate_share**progress
    return AdamRates(
        means=config.means_rate * decay,
        quats=config.quats_rate * decay,
        log_scales=config.log_scales_rate * decay,
        logit_opacities=config.logit_opacities_rate * decay,
        sh_dc=config.sh_rate * decay,
        sh_rest=config.sh_rate * decay / SH_REST_DIVISOR,
    )


def _round_means(losses: Sequence[float], steps: int) -> list[float]:
    """Return the mean loss of each complete round of `steps` steps."""
    complete = len(losses) // steps * steps
    means = np.reshape(losses[:complete], (-1, steps)).mean(axis=1)
    return [float(mean) for mean in means]


def _has_converged(losses: Sequence[float], config: RefineConfig) -> bool:
    """Return whether the loss fell by too little in the last rounds."""
    if len(losses) <= config.patience:
        return False
    before, after = min(losses[: -config.patience]), min(losses[-config.patience :])
    return after > before * (1 - config.min_gain)
