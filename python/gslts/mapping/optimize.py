"""Optimisation of a map against its training frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.adam import Adam, AdamRates
from gslts.alignment import Alignment, NormalEquations, align
from gslts.gaussian_map import SH_C0, GaussianMap
from gslts.losses import Exposure, depth_loss, fit_exposure, photometric_loss
from gslts.mapping.config import MappingConfig
from gslts.mapping.evaluate import exposed, psnr_db
from gslts.mapping.lenses import PIXELS_PER_FACT, after_step, corrected_lenses, pose_step
from gslts.mapping.pose import moved, twist_of
from gslts.mapping.training_frame import TrainingFrame
from gslts.render import Rasterizer, RenderOptions

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Progress:
    """How far an optimisation is."""

    iteration: int
    loss: float
    psnr_db: float
    gaussians: int


class Optimizer:
    """Fits a map to frames, step by step.

    Args:
        gaussian_map: Where to start, float32.
        frames: To be fitted; their poses, lenses and exposures are corrected in place.
        config: Settings.
    """

    def __init__(
        self, gaussian_map: GaussianMap, frames: list[TrainingFrame], config: MappingConfig
    ) -> None:
        self.adam = Adam(gaussian_map)
        self.frames, self.config = frames, config
        self.iteration = 0
        self.epoch = 0
        self.level = None
        self.given_lenses = frames[0].lenses
        self._rasterizer = Rasterizer(np.float32)
        self._rng = np.random.default_rng(config.seed)
        self._order: list[int] = []

    def run(self, report: Callable[[Progress], None]) -> None:
        """All iterations."""
        while self.iteration < self.config.iterations:
            if not self._order:
                if self.iteration > 0:
                    self._end_epoch()
                self._order = self._rng.permutation(len(self.frames)).tolist()
            share = self.iteration / self.config.iterations
            loss, psnr_db = self.step(self.frames[self._order.pop()], share)
            report(Progress(self.iteration, loss, psnr_db, self.adam.map.size))
        self._end_epoch()

    def step(self, frame: TrainingFrame, share: float) -> tuple[float, float]:
        """One frame, at a share of the whole schedule; returns the loss and PSNR (dB)."""
        config, threads = self.config, self.config.threads
        level = self.level if self.level is not None else 1 if share < config.coarse_share else 0
        photo, measured, camera = frame.photo(level), frame.depth(level), frame.camera(level)
        # Dark colours must not be made of missing Gaussians: what is behind is never the same.
        options = RenderOptions(threads=threads, background=self._rng.random(3))
        images = self._rasterizer.forward(self.adam.map, camera, options)
        frame.exposure = _sane(fit_exposure(images.rgb, photo, threads=threads))
        color = photometric_loss(
            images.rgb,
            photo,
            dssim_weight=config.dssim_weight,
            exposure=frame.exposure,
            threads=threads,
        )
        depth = depth_loss(images.depth, measured, relative=True, threads=threads)
        of_alpha = np.float32(-config.opacity_weight / images.alpha.size)
        gradients = self._rasterizer.backward(
            dL_drgb=color.dL_drgb,
            dL_ddepth=depth.dL_ddepth * np.float32(config.depth_weight),
            dL_dalpha=np.full(images.alpha.shape, of_alpha),
        )
        self.adam.step(gradients, self._rates(share), threads=threads)
        if config.refine_poses and self.iteration >= len(self.frames):
            alignment = align(
                camera,
                images.rgb,
                images.depth,
                photo,
                measured,
                exposure=frame.exposure,
                threads=threads,
            )
            self._refine_pose(frame, _at_full_size(alignment, 1 << level))
        self.iteration += 1
        some = (slice(None, None, 4),) * 2
        return color.value, psnr_db(exposed(images.rgb[some], frame.exposure), photo[some])

    def _refine_pose(self, frame: TrainingFrame, alignment: Alignment) -> None:
        """One Gauss-Newton step, held near the given pose."""
        stds = np.repeat([self.config.pose_std_m, self.config.pose_std_rad, 1], (3, 3, 4))
        prior = (np.arange(10) < 6) * PIXELS_PER_FACT / stds**2
        off = np.concatenate([twist_of(frame.off()), np.zeros(4)])
        given = NormalEquations(np.diag(prior), prior * off)
        import os; w=float(os.environ.get('DW','1'))
        alignment = Alignment(alignment.color, NormalEquations(alignment.depth.hessian*w, alignment.depth.right*w) + given)
        twist = pose_step(alignment)
        frame.pose = moved(frame.lenses.at(frame.pose), twist).world_from_camera
        frame.look = after_step(alignment, twist)

    def _correct_lenses(self) -> None:
        looks = [frame.look for frame in self.frames if frame.look is not None]
        if len(looks) < len(self.frames):
            return
        if self.epoch > 6 and self.epoch % 4:
            return
        lenses = corrected_lenses(self.frames[0].lenses, self.given_lenses, looks)
        for frame in self.frames:
            frame.set_lenses(lenses)
            frame.look = None

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
        """Removes what is faint, and folds the mean exposure into the map."""
        self.epoch += 1
        old = self.adam.map
        gains = np.array([frame.exposure.gain for frame in self.frames])
        offsets = np.array([frame.exposure.offset for frame in self.frames])
        gain, offset = gains.mean(axis=0), offsets.mean(axis=0)
        kept = np.flatnonzero(old.logit_opacities > _logit(self.config.min_opacity))
        sh = old.sh[kept] * gain.astype(np.float32)
        sh[:, 0] += ((0.5 * gain + offset - 0.5) / SH_C0).astype(np.float32)
        for frame, of_gain, of_offset in zip(self.frames, gains, offsets, strict=True):
            ratio = of_gain / gain
            frame.exposure = Exposure(gain=ratio, offset=of_offset - ratio * offset)
        cleaned = GaussianMap(
            means=old.means[kept],
            quats=old.quats[kept],
            log_scales=np.minimum(
                old.log_scales[kept], np.float32(np.log(self.config.max_scale_m))
            ),
            logit_opacities=old.logit_opacities[kept],
            sh=sh,
            ids=old.ids[kept],
            origin=old.origin,
        )
        self.adam = self.adam.edited(cleaned, kept)
        if self.config.refine_lenses:
            self._correct_lenses()


def _at_full_size(alignment: Alignment, divisor: int) -> Alignment:
    """Equations for the principal point in px of the full image."""
    scale = np.ones(10)
    scale[8:] = 1 / divisor

    def scaled(equations: NormalEquations) -> NormalEquations:
        hessian = equations.hessian * scale[:, None] * scale
        return NormalEquations(hessian, equations.right * scale)

    return Alignment(scaled(alignment.color), scaled(alignment.depth))


def _sane(exposure: Exposure) -> Exposure:
    """The fit, unless the image could not tell."""
    gain, offset = np.array(exposure.gain), np.array(exposure.offset)
    good = (gain > 0.3).all() and (gain < 3).all() and (np.abs(offset) < 0.5).all()
    return exposure if good else Exposure()


def _logit(share: float) -> float:
    return float(np.log(share / (1 - share)))
