"""Optimisation of a map against observations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.core.camera import shift_origin
from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.core.se3 import fit_rigid_motion, se3_retract, twist_of
from gslts.localization.alignment import (
    Alignment,
    NormalEquations,
    align,
)
from gslts.localization.constants import CORRELATED_PIXELS, DEPTH_WEIGHT
from gslts.mapping import clock
from gslts.mapping.config import MappingConfig
from gslts.mapping.density.control import joined, split
from gslts.mapping.gauge import move_map
from gslts.mapping.lenses import Lenses, after_step, corrected_lenses, pose_step
from gslts.mapping.observation import Observation
from gslts.mapping.seeding.hole_seeds import seeds_in_holes
from gslts.rendering.adam import Adam, AdamRates
from gslts.rendering.losses import (
    Exposure,
    apply_exposure,
    depth_loss,
    fit_exposure,
    photometric_loss,
)
from gslts.rendering.metrics import psnr_db
from gslts.rendering.rasterizer import Images, Rasterizer, RenderOptions
from gslts.types import Floats32

HOLE_EPOCHS = (1, 4)
"""Epochs in which holes are filled: once the poses are roughly right, and once more."""
LENS_EPOCHS = (1, 2, 3, 4, 5, 6, 8, 12, 16, 24, 32, 48, 64)
"""Epochs after which lenses are corrected; all depth has to be registered anew each time."""
GROWTH_SHARES = (0.1, 0.6)
"""Of the schedule, when Gaussians are split: poses are roughly right, and there is time left."""
LEAST_SPLIT = 0.15
"""Of a voxel: standard deviation of the smallest Gaussians that are split."""
SHOWN_PIXELS = (slice(None, None, 4), slice(None, None, 4))
"""Of which the PSNR of the progress is made."""


@dataclass(frozen=True)
class Progress:
    """How far an optimisation is.

    Attributes:
        iteration: Steps done.
        share: Of the schedule, 0 to 1.
        loss: Of the colours, in the last step.
        psnr_db: Of a part of the pixels, in the last step.
        gaussians: In the map.
    """

    iteration: int
    share: float
    loss: float
    psnr_db: float
    gaussians: int


@dataclass(frozen=True)
class Schedule:
    """What an optimisation does when.

    Attributes:
        iterations: Steps at most.
        levels: Shares of the schedule, and the resolution that is used up to each.
        times_s: By `gslts.mapping.clock.now_s`, when it starts and when it ends, in the place of
            a number of steps; None means no such limit.
    """

    iterations: int
    levels: tuple[tuple[float, int], ...]
    times_s: tuple[float, float] | None = None

    def level(self, share: float) -> int:
        """Of the images."""
        return next(level for until, level in self.levels if share < until)


class Optimizer:
    """Fits a map to observations, step by step.

    Args:
        gaussian_map: Where to start, float32.
        observations: To be fitted; poses, lenses and exposures are corrected in place.
        given: The lenses as the data set says.
        config: Settings.
        schedule: What is done when.
    """

    def __init__(
        self,
        gaussian_map: GaussianMap,
        observations: Sequence[Observation],
        given: Lenses,
        config: MappingConfig,
        schedule: Schedule,
    ) -> None:
        self.adam = Adam(gaussian_map)
        self.observations, self.given = observations, given
        self.config, self.schedule = config, schedule
        self.iteration = self.epoch = 0
        self.rng = np.random.default_rng(config.seed)
        self._rasterizer = Rasterizer(np.float32)
        self._strains: Floats32 | None = None  # [N] of `abs_dL_dmeans2d` in this epoch

    @property
    def share(self) -> float:
        """Of the schedule that is done."""
        if self.schedule.times_s is None:
            return self.iteration / self.schedule.iterations
        start_s, end_s = self.schedule.times_s
        return (clock.now_s() - start_s) / max(1e-3, end_s - start_s)

    def run_epoch(self, report: Callable[[Progress], None]) -> None:
        """Visits each observation once, or fewer at the end of the schedule."""
        start = self.share
        for one in self.observations:
            one.look = None
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
        """Fits the map to one observation, at a share of the schedule."""
        config, threads = self.config, self.config.threads
        level = self.schedule.level(share)
        photo, mask = observation.photo(level), observation.mask(level)
        measured, camera = observation.depth(level), observation.camera(level)
        # Dark colours must not be made of missing Gaussians: what is behind is never the same.
        options = RenderOptions(threads=threads, background=self.rng.random(3).tolist())
        images = self._rasterizer.forward(self.adam.map, camera, options)
        exposure = _sane(fit_exposure(images.rgb, photo, mask=mask, threads=threads))
        observation.exposure = exposure
        color = photometric_loss(
            images.rgb,
            photo,
            mask=mask,
            dssim_weight=config.dssim_weight,
            exposure=exposure,
            threads=threads,
        )
        depth = depth_loss(images.depth, measured, mask=mask, relative=True, threads=threads)
        of_alpha = np.float32(-config.opacity_weight / images.alpha.size)
        gradients = self._rasterizer.backward(
            dL_drgb=color.dL_drgb,
            dL_ddepth=depth.dL_ddepth * np.float32(config.depth_weight),
            dL_dalpha=np.full(images.alpha.shape, of_alpha) if mask is None else mask * of_alpha,
            statistics=self._strains is not None,
        )
        if self._strains is not None:
            assert gradients.abs_dL_dmeans2d is not None  # They were asked for.
            self._strains[gradients.rows] += np.linalg.norm(gradients.abs_dL_dmeans2d, axis=1)
        self.adam.step(gradients, self._rates(share), threads=threads)
        if config.refine_poses and self.epoch > 0:
            alignment = align(
                camera,
                images.rgb,
                images.depth,
                photo,
                measured,
                mask=mask,
                exposure=exposure,
                threads=threads,
            )
            self._refine_pose(observation, alignment.at_full_size(1 << level))
        if config.fill_holes and self.epoch in HOLE_EPOCHS:
            self._fill_holes(observation, images, level)
        self.iteration += 1
        shown = apply_exposure(images.rgb[SHOWN_PIXELS], exposure)
        return Progress(
            iteration=self.iteration,
            share=self.share,
            loss=color.value,
            psnr_db=psnr_db(shown, photo[SHOWN_PIXELS]),
            gaussians=self.adam.map.size,
        )

    def _refine_pose(self, observation: Observation, alignment: Alignment) -> None:
        """One Gauss-Newton step, held near the given pose."""
        stds = np.repeat([self.config.pose_std_m, self.config.pose_std_rad, 1], (3, 3, 4))
        prior = (np.arange(10) < 6) * CORRELATED_PIXELS / stds**2
        off = np.concatenate([-twist_of(observation.correction), np.zeros(4)])
        prior_equations = NormalEquations(np.diag(prior), prior * off)
        depth = alignment.depth
        weak = NormalEquations(DEPTH_WEIGHT * depth.hessian, DEPTH_WEIGHT * depth.right)
        twist = pose_step(Alignment(alignment.color, weak + prior_equations))
        observation.pose = se3_retract(observation.pose, twist)
        whole = Alignment(alignment.color, depth + prior_equations)
        observation.look = after_step(whole, twist)

    def _fill_holes(self, observation: Observation, images: Images, level: int) -> None:
        exposure, old = observation.exposure, self.adam.map
        gain, offset = (np.array(one, np.float32) for one in (exposure.gain, exposure.offset))
        colors = ((observation.photo(level) - offset) / gain).clip(0, 1)
        camera = shift_origin(observation.camera(level), old.origin)
        new = seeds_in_holes(camera, images, colors, observation.depth(level), old.sh_degree)
        most = self.config.max_gaussians
        if new is not None and (most is None or old.size + new.size <= most):
            rows = np.concatenate([np.arange(old.size), np.full(new.size, -1)])
            self.adam = self.adam.edited(joined(old, new), rows)
            if self._strains is not None:
                self._strains = np.concatenate([self._strains, np.zeros(new.size, np.float32)])

    def _grow(self, strains: Floats32, share: float) -> None:
        """Splits those that the images pull at from all sides (AbsGS, Ye et al. 2024).

        Args:
            strains: [N] summed over views.
            share: Of the schedule that passed meanwhile.
        """
        old, config = self.adam.map, self.config
        first, last = GROWTH_SHARES
        count = int(old.size * ((1 + config.growth) ** (share / (last - first)) - 1))
        if config.max_gaussians is not None:
            count = min(count, config.max_gaussians - old.size)
        wide = old.log_scales.max(axis=1) > np.log(LEAST_SPLIT * config.voxel_m)
        rows = np.flatnonzero(wide & (strains > 0))
        rows = np.sort(rows[np.argsort(-strains[rows], kind="stable")[: max(0, count)]])
        came_from = np.concatenate([np.arange(old.size), np.full(rows.size, -1)])
        self.adam = self.adam.edited(split(old, rows), came_from)
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
        kept = np.flatnonzero(self.adam.map.logit_opacities > _logit(self.config.min_opacity))
        cleaned = self._with_mean_exposure(self.adam.map.select(kept))
        if self.config.refine_lenses and self.epoch in LENS_EPOCHS:
            self._correct_lenses()
        if self.config.refine_poses:
            cleaned = self._anchored(cleaned)
        self.adam = self.adam.edited(cleaned, kept)
        self.epoch += 1

    def _with_mean_exposure(self, old: GaussianMap) -> GaussianMap:
        """The map with the mean exposure of the observations, which keep what differs from it."""
        gains = np.array([one.exposure.gain for one in self.observations])
        offsets = np.array([one.exposure.offset for one in self.observations])
        gain, offset = gains.mean(axis=0), offsets.mean(axis=0)
        sh = old.sh * gain.astype(np.float32)
        sh[:, 0] += ((0.5 * gain + offset - 0.5) / SH_C0).astype(np.float32)
        for one, of_gain, of_offset in zip(self.observations, gains, offsets, strict=True):
            ratio = of_gain / gain
            one.exposure = Exposure(gain=ratio, offset=of_offset - ratio * offset)
        greatest = np.float32(np.log(self.config.max_scale_m))
        return replace(old, log_scales=np.minimum(old.log_scales, greatest), sh=sh)

    def _anchored(self, old: GaussianMap) -> GaussianMap:
        """The map, and with it all observations, back where the given poses put them."""
        poses = np.array([one.pose for one in self.observations])
        given = np.array([one.given_pose for one in self.observations])
        from_cameras = old.means + (old.origin - poses[:, :3, 3].mean(axis=0))
        arm_m = float(np.median(np.linalg.norm(from_cameras, axis=1)))
        motion = fit_rigid_motion(poses, given, arm_m)
        for one in self.observations:
            one.pose = motion @ one.pose
        return move_map(old, motion)

    def _correct_lenses(self) -> None:
        looks = [one.look for one in self.observations if one.look is not None]
        if len(looks) < len(self.observations):
            return
        lenses = corrected_lenses(self.observations[0].lenses, self.given, looks)
        for one in self.observations:
            one.set_lenses(lenses)


def _sane(exposure: Exposure) -> Exposure:
    """The fit, unless the image could not tell."""
    gain, offset = np.array(exposure.gain), np.array(exposure.offset)
    good = (gain > 0.3).all() and (gain < 3).all() and (np.abs(offset) < 0.5).all()
    return exposure if good else Exposure()


def _logit(share: float) -> float:
    return float(np.log(share / (1 - share)))
