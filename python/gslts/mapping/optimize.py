"""Optimization of Gaussians, poses, lenses and exposures against the training frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.core.camera import Camera, shift_origin
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import se3_retract, twist_of
from gslts.localization.alignment import (
    Alignment,
    NormalEquations,
    align,
)
from gslts.localization.constants import CORRELATED_PIXELS, DEPTH_WEIGHT
from gslts.mapping import clock
from gslts.mapping.config import MappingConfig
from gslts.mapping.density.control import join, split
from gslts.mapping.exposures import fold_mean_exposure, refit_exposure
from gslts.mapping.gauge import restore_gauge
from gslts.mapping.lenses import Lenses, after_step, pose_step, refine_lenses
from gslts.mapping.observation import Observation
from gslts.mapping.seeding.hole_seeds import seed_holes
from gslts.rendering.adam import Adam, AdamRates
from gslts.rendering.losses import (
    Exposure,
    apply_exposure,
    depth_loss,
    photometric_loss,
)
from gslts.rendering.metrics import psnr_db
from gslts.rendering.rasterizer import Gradients, Images, Rasterizer, RenderOptions
from gslts.types import Bools, Floats32, Ints

HOLE_EPOCHS = (1, 4)
"""Epochs in which holes are filled: once the poses are roughly right, and once more."""
LENS_EPOCHS = (1, 2, 3, 4, 5, 6, 8, 12, 16, 24, 32, 48, 64)
"""Epochs after which lenses are refined; ever more rarely, as all depth is registered anew."""
GROWTH_SHARES = (0.1, 0.6)
"""Shares of the schedule between which Gaussians are split: poses are roughly right by then, and
time is left to fit the halves."""
MIN_SPLIT_VOXELS = 0.15
"""Smallest standard deviation of a Gaussian that is split, in voxels."""
PROGRESS_PIXELS = (slice(None, None, 4), slice(None, None, 4))
"""Pixels of which the PSNR of the progress is computed: every 4th in each direction, for speed."""


@dataclass(frozen=True)
class Progress:
    """State of an optimization after a step.

    Attributes:
        iteration: Number of steps.
        share: Share of the schedule, 0 to 1.
        loss: Colour loss of the last step.
        psnr_db: PSNR of `PROGRESS_PIXELS` in the last step, dB.
        gaussians: Number of Gaussians.
    """

    iteration: int
    share: float
    loss: float
    psnr_db: float
    gaussians: int


@dataclass(frozen=True)
class Schedule:
    """Length of an optimization, and its resolutions.

    Attributes:
        iterations: Number of steps.
        levels: Pairs (share of the schedule, resolution used up to it), ascending.
        times_s: Start and end by `gslts.mapping.clock.now_s`, s; they replace the number of steps.
    """

    iterations: int
    levels: tuple[tuple[float, int], ...]
    times_s: tuple[float, float] | None = None

    def level(self, share: float) -> int:
        """Return the resolution at a share of the schedule.

        Args:
            share: 0 to 1.
        """
        return next(level for until, level in self.levels if share < until)


@dataclass(frozen=True, eq=False)
class _Target:
    """Images of one observation at one resolution, and the camera there."""

    camera: Camera
    rgb: Floats32
    depth: Floats32
    mask: Bools | None

    @classmethod
    def of(cls, observation: Observation, level: int) -> _Target:
        return cls(
            camera=observation.camera(level),
            rgb=observation.color(level),
            depth=observation.depth(level),
            mask=observation.mask(level),
        )


class Optimizer:
    """Fits a map to observations, step by step.

    Args:
        gaussian_map: Initial map, float32.
        observations: Training frames; their poses, lenses and exposures are refined in place.
        given: Lenses by the data set.
        config: Settings.
        schedule: Length and resolutions.
        fixed: [N] Gaussians that stay as they are, bit by bit; they also fix the gauge. None means
            that all are free.
        mean_exposure: Of the frames that show none of the fixed Gaussians; it is arbitrary, but
            must be that of the others.
    """

    def __init__(
        self,
        gaussian_map: GaussianMap,
        observations: Sequence[Observation],
        given: Lenses,
        config: MappingConfig,
        schedule: Schedule,
        fixed: Bools | None = None,
        mean_exposure: Exposure | None = None,
    ) -> None:
        self.adam = Adam(gaussian_map)
        self.fixed = np.zeros(gaussian_map.size, np.bool_) if fixed is None else fixed
        self.mean_exposure = Exposure() if mean_exposure is None else mean_exposure
        self.observations, self.given = observations, given
        self.config, self.schedule = config, schedule
        self.iteration = self.epoch = 0
        self.rng = np.random.default_rng(config.seed)
        self._rasterizer = Rasterizer(np.float32)
        self._strains: Floats32 | None = None  # [N] sum of `abs_dL_dmeans2d` over this epoch

    @property
    def share(self) -> float:
        """Share of the schedule that is done; above 1 once its time is over."""
        if self.schedule.times_s is None:
            return self.iteration / self.schedule.iterations
        start_s, end_s = self.schedule.times_s
        return (clock.now_s() - start_s) / max(1e-3, end_s - start_s)

    def run_epoch(self, report: Callable[[Progress], None]) -> None:
        """Visit each observation once, or fewer at the end of the schedule.

        Args:
            report: Called after each step.
        """
        start = self.share
        for observation in self.observations:
            observation.alignment = None
        if self.config.growth > 0 and GROWTH_SHARES[0] <= start < GROWTH_SHARES[1]:
            self._strains = np.zeros(self.adam.map.size, np.float32)
        for index in self.rng.permutation(len(self.observations)):
            share = self.share
            if share >= 1:
                break
            report(self.step(self.observations[index], share))
        if self._strains is not None:
            self._grow(self._strains, min(self.share, GROWTH_SHARES[1]) - start)
        self._end_epoch()

    def step(self, observation: Observation, share: float) -> Progress:
        """Fit the map to one observation.

        Args:
            observation: One of the training frames.
            share: Share of the schedule that is done.

        Returns:
            The state after the step.
        """
        config, threads = self.config, self.config.threads
        level = self.schedule.level(share)
        target = _Target.of(observation, level)
        # A random background keeps dark colours from being made of missing Gaussians.
        options = RenderOptions(threads=threads, background=self.rng.random(3).tolist())
        images = self._rasterizer.forward(self.adam.map, target.camera, options)
        refit_exposure(observation, images.rgb, target.rgb, target.mask, threads)
        loss, gradients = self._gradients(images, target, observation.exposure)
        self.adam.step(gradients.select(~self.fixed), self._rates(share), threads=threads)
        if config.refine_poses and self.epoch > 0:
            self._refine_pose(observation, images, target, level)
        if config.fill_holes and self.epoch in HOLE_EPOCHS:
            self._fill_holes(observation, images, target, level)
        self.iteration += 1
        rendered = apply_exposure(images.rgb[PROGRESS_PIXELS], observation.exposure)
        seen = None if target.mask is None else target.mask[PROGRESS_PIXELS]
        seen = seen if seen is not None and seen.any() else None
        return Progress(
            iteration=self.iteration,
            share=self.share,
            loss=loss,
            psnr_db=psnr_db(rendered, target.rgb[PROGRESS_PIXELS], seen),
            gaussians=self.adam.map.size,
        )

    def _gradients(
        self, images: Images, target: _Target, exposure: Exposure
    ) -> tuple[float, Gradients]:
        """Return the colour loss and the gradients of the whole loss."""
        config, threads, mask = self.config, self.config.threads, target.mask
        color = photometric_loss(
            images.rgb,
            target.rgb,
            mask=mask,
            dssim_weight=config.dssim_weight,
            exposure=exposure,
            threads=threads,
        )
        depth = depth_loss(images.depth, target.depth, mask=mask, relative=True, threads=threads)
        dL_dalpha = np.float32(-config.opacity_weight / images.alpha.size)
        gradients = self._rasterizer.backward(
            dL_drgb=color.dL_drgb,
            dL_ddepth=depth.dL_ddepth * np.float32(config.depth_weight),
            dL_dalpha=np.full(images.alpha.shape, dL_dalpha) if mask is None else mask * dL_dalpha,
            statistics=self._strains is not None,
        )
        if self._strains is not None:
            assert gradients.abs_dL_dmeans2d is not None  # Requested by `statistics`.
            self._strains[gradients.rows] += np.linalg.norm(gradients.abs_dL_dmeans2d, axis=1)
        return color.value, gradients

    def _refine_pose(
        self, observation: Observation, images: Images, target: _Target, level: int
    ) -> None:
        """Take one Gauss-Newton step of the pose, with the given pose as a prior."""
        alignment = align(
            target.camera,
            images.rgb,
            images.depth,
            target.rgb,
            target.depth,
            mask=target.mask,
            exposure=observation.exposure,
            threads=self.config.threads,
        ).at_full_size(1 << level)
        stds = np.repeat([self.config.pose_std_m, self.config.pose_std_rad, 1], (3, 3, 4))
        weights = (np.arange(10) < 6) * CORRELATED_PIXELS / stds**2
        offset = np.concatenate([-twist_of(observation.correction), np.zeros(4)])
        prior = NormalEquations(np.diag(weights), weights * offset)
        depth = alignment.depth
        weak = NormalEquations(DEPTH_WEIGHT * depth.hessian, DEPTH_WEIGHT * depth.right)
        twist = pose_step(Alignment(alignment.color, weak + prior))
        observation.world_from_camera = se3_retract(observation.world_from_camera, twist)
        observation.alignment = after_step(Alignment(alignment.color, depth + prior), twist)

    def _fill_holes(
        self, observation: Observation, images: Images, target: _Target, level: int
    ) -> None:
        exposure, old = observation.exposure, self.adam.map
        gain, offset = (np.array(part, np.float32) for part in (exposure.gain, exposure.offset))
        colors = ((target.rgb - offset) / gain).clip(0, 1)
        camera = shift_origin(observation.camera(level), old.origin)
        measured, mask = observation.depth(level), target.mask
        new = seed_holes(camera, images, colors, measured, mask, old.sh_degree)
        limit = self.config.max_gaussians
        if new is not None and (limit is None or old.size + new.size <= limit):
            rows = np.concatenate([np.arange(old.size), np.full(new.size, -1)])
            self._edit(join(old, new), rows)
            if self._strains is not None:
                self._strains = np.concatenate([self._strains, np.zeros(new.size, np.float32)])

    def _grow(self, strains: Floats32, share: float) -> None:
        """Split the Gaussians with the greatest gradients (AbsGS, Ye et al. 2024).

        Args:
            strains: [N] sums of absolute gradients over the frames of the epoch.
            share: Share of the schedule that passed in the epoch.
        """
        old, config = self.adam.map, self.config
        first, last = GROWTH_SHARES
        count = int((~self.fixed).sum() * ((1 + config.growth) ** (share / (last - first)) - 1))
        if config.max_gaussians is not None:
            count = min(count, config.max_gaussians - old.size)
        wide = old.log_scales.max(axis=1) > np.log(MIN_SPLIT_VOXELS * config.voxel_m)
        rows = np.flatnonzero(wide & (strains > 0) & ~self.fixed)
        rows = np.sort(rows[np.argsort(-strains[rows], kind="stable")[: max(0, count)]])
        old_rows = np.concatenate([np.arange(old.size), np.full(rows.size, -1)])
        self._edit(split(old, rows), old_rows)
        self._strains = None

    def _rates(self, share: float) -> AdamRates:
        config = self.config
        left = config.rates_left**share
        return AdamRates(
            means=config.means_rate * config.means_left**share,
            quats=config.quats_rate * left,
            log_scales=config.log_scales_rate * left,
            logit_opacities=config.logit_opacities_rate * left,
            sh_dc=config.sh_rate * left,
            sh_rest=config.sh_rate * left / 20,
        )

    def _end_epoch(self) -> None:
        """Prune, clamp scales, and fix what the images leave free: exposure and gauge."""
        config, observations = self.config, self.observations
        opaque = self.adam.map.logit_opacities > _logit(config.min_opacity)
        kept = np.flatnonzero(opaque | self.fixed)
        if len(kept) == 0:
            raise ValueError(
                f"every Gaussian was pruned: none is more opaque than min_opacity="
                f"{config.min_opacity:g}"
            )
        gaussians, fixed = self.adam.map.select(kept), self.fixed[kept]
        gaussians = fold_mean_exposure(gaussians, observations, fixed, self.mean_exposure)
        limits = np.where(fixed, np.inf, np.log(config.max_scale_m)).astype(np.float32)
        log_scales = np.minimum(gaussians.log_scales, limits[:, None])
        gaussians = replace(gaussians, log_scales=log_scales)
        if config.refine_lenses and self.epoch in LENS_EPOCHS:
            self._refine_lenses()
        if config.refine_poses and not fixed.any():
            gaussians = restore_gauge(gaussians, observations)
        self._edit(gaussians, kept)
        self.epoch += 1

    def _edit(self, gaussian_map: GaussianMap, rows: Ints) -> None:
        """Replace the map; `rows` [M] are those of its Gaussians in the old one, -1 if new."""
        self.adam = self.adam.edit(gaussian_map, rows)
        self.fixed = np.where(rows >= 0, self.fixed[rows], False)

    def _refine_lenses(self) -> None:
        alignments = [o.alignment for o in self.observations if o.alignment is not None]
        if len(alignments) < len(self.observations):
            return
        lenses = refine_lenses(self.observations[0].lenses, self.given, alignments)
        for observation in self.observations:
            observation.set_lenses(lenses)


def _logit(share: float) -> float:
    return float(np.log(share / (1 - share))) if share > 0 else -np.inf
