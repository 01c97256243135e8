"""Optimisation of a map against its training frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gslts.adam import Adam, AdamRates
from gslts.camera import Camera, resized
from gslts.frame import RgbdFrame
from gslts.gaussian_map import SH_C0, GaussianMap
from gslts.losses import Exposure, fit_exposure, photometric_loss
from gslts.mapping.config import MappingConfig
from gslts.mapping.evaluate import exposed, psnr_db
from gslts.mapping.pose import NormalEquations, align, moved, twist_between
from gslts.render import Rasterizer, RenderOptions

Floats32 = NDArray[np.float32]

PIXELS_PER_FACT = 50.0
"""Neighbouring pixels err together: so many count as one independent measurement."""


@dataclass(eq=False)
class TrainingFrame:
    """A frame, and what has been found out about it.

    Attributes:
        levels: Colour and depth, at full and at half resolution.
        given: The camera of the data set.
        camera: The camera as corrected.
        exposure: From the map's colours to those of the frame.
    """

    levels: list[tuple[NDArray[np.uint8], Floats32]]
    given: Camera
    camera: Camera
    exposure: Exposure = field(default_factory=Exposure)

    @classmethod
    def of(cls, frame: RgbdFrame) -> TrainingFrame:
        """A frame at both resolutions."""
        half = (_halved(frame.rgb), _halved_depth(frame.depth))
        return cls([(frame.rgb, frame.depth), half], frame.camera, frame.camera)


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
        frames: To be fitted; their poses and exposures are corrected in place.
        config: Settings.
    """

    def __init__(
        self, gaussian_map: GaussianMap, frames: list[TrainingFrame], config: MappingConfig
    ) -> None:
        self.adam = Adam(gaussian_map)
        self.frames, self.config = frames, config
        self.iteration = 0
        self._rasterizer = Rasterizer(np.float32)
        self._options = RenderOptions(threads=config.threads)
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
        level = 1 if share < config.coarse_share else 0
        rgb_bytes, measured = frame.levels[level]
        photo = rgb_bytes.astype(np.float32) / 255
        camera = resized(frame.camera, 1 << level)
        images = self._rasterizer.forward(self.adam.map, camera, self._options)
        frame.exposure = _sane(fit_exposure(images.rgb, photo, threads=threads))
        color = photometric_loss(
            images.rgb,
            photo,
            dssim_weight=config.dssim_weight,
            exposure=frame.exposure,
            threads=threads,
        )
        valid = (measured > 0) & (images.depth > 0)
        error = np.where(valid, images.depth - measured, 0)
        weight = config.depth_weight / max(1, int(valid.sum()))
        dL_ddepth = weight * np.sign(error) / np.where(valid, measured, 1)
        dL_dalpha = np.full(images.alpha.shape, -config.opacity_weight / images.alpha.size)
        gradients = self._rasterizer.backward(
            dL_drgb=color.dL_drgb,
            dL_ddepth=dL_ddepth.astype(np.float32),
            dL_dalpha=dL_dalpha.astype(np.float32),
        )
        self.adam.step(gradients, self._rates(share), threads=threads)
        corrected = exposed(images.rgb, frame.exposure)
        if config.refine_poses and self.iteration >= len(self.frames):
            equations = align(camera, corrected, images.depth, photo, measured)
            frame.camera = self._refined(frame, equations)
        self.iteration += 1
        return color.value, psnr_db(corrected, photo)

    def _refined(self, frame: TrainingFrame, equations: NormalEquations) -> Camera:
        """One Gauss-Newton step, held near the given pose."""
        config = self.config
        stds = np.repeat([config.pose_std_m, config.pose_std_rad], 3)
        prior = PIXELS_PER_FACT / stds**2
        off = twist_between(frame.camera, frame.given)
        hessian = equations.hessian + np.diag(prior)
        step = np.linalg.solve(hessian, equations.right + prior * off).astype(np.float64)
        return moved(frame.camera, step)

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


def _sane(exposure: Exposure) -> Exposure:
    """The fit, unless the image could not tell."""
    gain, offset = np.array(exposure.gain), np.array(exposure.offset)
    good = (gain > 0.3).all() and (gain < 3).all() and (np.abs(offset) < 0.5).all()
    return exposure if good else Exposure()


def _logit(share: float) -> float:
    return float(np.log(share / (1 - share)))


def _halved(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = (length // 2 * 2 for length in rgb.shape[:2])
    part = rgb[:height, :width].astype(np.uint16)
    total = part[::2, ::2] + part[1::2, ::2] + part[::2, 1::2] + part[1::2, 1::2]
    return ((total + 2) // 4).astype(np.uint8)


def _halved_depth(depth: Floats32) -> Floats32:
    """Means of 2 x 2 pixels where all are measured and on one surface, else 0."""
    height, width = (length // 2 * 2 for length in depth.shape)
    part = np.nan_to_num(depth[:height, :width])
    four = np.stack([part[::2, ::2], part[1::2, ::2], part[::2, 1::2], part[1::2, 1::2]])
    same = (four.min(axis=0) > 0) & (np.ptp(four, axis=0) < 0.05 * four.max(axis=0))
    return np.where(same, four.mean(axis=0), 0).astype(np.float32)
