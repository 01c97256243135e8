"""Refinement of an edited map: pixels near the change are rendered, Gaussians near it move."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, replace

import cv2
import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.adam import Adam, AdamRates
from gslts.rendering.losses import Exposure, depth_loss, photometric_loss
from gslts.rendering.rasterizer import Gradients, Rasterizer, RenderOptions
from gslts.types import Bools, Floats32
from gslts.update.config import RefineConfig
from gslts.update.region import Region
from gslts.update.views import View

Watch = Callable[[int, Callable[[], GaussianMap]], None]
"""Is told how many steps were done, and may ask for the map as it is then."""

EDITED = 0.02
"""A colour that the edit changed by more is not remembered, nor are those beside it."""
EDGE_PX = 5


@dataclass(frozen=True, eq=False)
class Target:
    """What the map is to show from somewhere.

    Attributes:
        camera: There.
        colors: [H,W,3] sRGB, 0 to 1.
        exposure: From the map's colours to these.
        depth: [H,W] m; 0 where it is not known.
        mask: [H,W] pixels that are compared; None means all.
        visits: How often it is fitted in a round of all targets.
    """

    camera: Camera
    colors: Floats32
    exposure: Exposure
    depth: Floats32
    mask: Bools | None
    visits: int = 1


@dataclass(frozen=True, eq=False)
class Refined:
    """A refined map.

    Attributes:
        gaussian_map: All but the Gaussians that could move are bit-identical.
        iterations: Steps that were done.
        losses: Mean loss of each whole round of the targets.
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
    watch: Watch = lambda *_: None,
) -> Refined:
    """Fits some Gaussians to what the map is to show; the same for any number of threads.

    Args:
        gaussian_map: float32.
        targets: From `targets_of` and `remembered`.
        active: [N] bool, Gaussians that may move.
        config: Settings.
        threads: 0 means one a hardware thread.
        watch: Is told of each step.
    """
    if len(targets) == 0 or not active.any():
        return Refined(gaussian_map, 0, ())
    fit = _Fit(gaussian_map, targets, active, config, threads)
    rng = np.random.default_rng(config.seed)
    losses: list[float] = []
    a_round = np.repeat(np.arange(len(targets)), [target.visits for target in targets])
    for step in range(config.iterations):
        place = step % len(a_round)
        if place == 0:
            if _settled(_by_round(losses, len(a_round)), config):
                break
            order = rng.permutation(a_round)
        background = rng.random(3).tolist()
        losses.append(fit.step(targets[order[place]], step / config.iterations, background))
        watch(step + 1, fit.current)
    if not losses:
        return Refined(gaussian_map, 0, ())
    return Refined(fit.current(), len(losses), tuple(_by_round(losses, len(a_round))))


class _Fit:
    """The part of a map that has to do with the targets, on its way."""

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
        self._rows = np.flatnonzero(_seen(gaussian_map, targets, threads) | active)
        self._moving = active[self._rows]
        self._adam = Adam(gaussian_map.select(self._rows))

    def step(self, target: Target, share: float, background: list[float]) -> float:
        """One step at a share of all; the loss before it."""
        config, threads = self._config, self._threads
        # Dark colours must not be made of missing Gaussians: what is behind is never the same.
        options = RenderOptions(threads=threads, background=background)
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
        self._adam.step(_of(gradients, self._moving), _rates(config, share), threads=threads)
        return color.value

    def current(self) -> GaussianMap:
        """The whole map as it is now."""
        rows = self._rows[self._moving]
        arrays = {}
        for name in ("means", "quats", "log_scales", "logit_opacities", "sh", "features"):
            array = getattr(self._whole, name).copy()
            array[rows] = getattr(self._adam.map, name)[self._moving]
            arrays[name] = array
        return replace(self._whole, **arrays)


def targets_of(
    views: Iterable[View], regions: Sequence[Region], config: RefineConfig
) -> list[Target]:
    """What views show, and where they are compared with the map.

    Args:
        views: Of the changes.
        regions: Where something changed.
        config: Settings; its scope decides where.
    """
    targets = []
    for view in views:
        mask = view.frame.mask
        if config.scope == "region":
            mask = around(view, regions, config.around_px)
            if not mask.any():
                continue
        photo = view.frame.rgb.astype(np.float32) / np.float32(255)
        target = Target(
            view.camera, photo, view.exposure, view.depth, mask, visits=config.new_visits
        )
        targets.append(target)
    return targets


def remembered(
    before: GaussianMap,
    edited: GaussianMap,
    cameras: Sequence[Camera],
    regions: Sequence[Region],
    config: RefineConfig,
    *,
    threads: int = 0,
) -> list[Target]:
    """What the map showed around a change from where it was made, but for what was edited.

    Args:
        before: The map before the edit.
        edited: And after it.
        cameras: Of the frames that it was made of.
        regions: Where something changed.
        config: Settings.
        threads: 0 means one a hardware thread.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    targets = []
    for camera in _spread(cameras, regions, config.remembered):
        mask = np.zeros((camera.height, camera.width), np.bool_)
        for region in regions:
            _add_rectangle(mask, region.rectangle(camera, config.around_px))
        new = rasterizer.forward(edited, camera, options, mask=mask)
        old = rasterizer.forward(before, camera, options, mask=mask)
        apart = np.abs(new.rgb - old.rgb).max(axis=2) > EDITED
        mask &= cv2.dilate(apart.astype(np.uint8), np.ones((EDGE_PX, EDGE_PX))) == 0
        if mask.any():
            depth = np.where(old.alpha > 0.5, old.depth, 0).astype(np.float32)
            colors = np.asarray(old.rgb, np.float32)
            targets.append(Target(camera, colors, Exposure(), depth, mask))
    return targets


def _spread(cameras: Sequence[Camera], regions: Sequence[Region], count: int) -> list[Camera]:
    """Cameras that look at regions, from places as different as can be."""
    looking = [one for one in cameras if any(region.middle_in(one) for region in regions)]
    places = np.array([one.world_from_camera[:3, 3] for one in looking]).reshape(-1, 3)
    nearest_m = np.full(len(looking), np.inf)
    chosen: list[Camera] = []
    while len(chosen) < min(count, len(looking)):
        best = int(np.argmax(nearest_m))
        chosen.append(looking[best])
        nearest_m = np.minimum(nearest_m, np.linalg.norm(places - places[best], axis=1))
        nearest_m[best] = -1  # Others may stand at the very place.
    return chosen


def _add_rectangle(mask: Bools, rectangle: tuple[int, int, int, int] | None) -> None:
    if rectangle is not None:
        x0, y0, x1, y1 = rectangle
        mask[y0:y1, x0:x1] = True


def around(view: View, regions: Sequence[Region], margin_px: int) -> Bools:
    """[H,W] the pixels of a view that may show regions, and those around.

    Args:
        view: Of the changes.
        regions: Where something changed.
        margin_px: How far around the boxes of the regions.
    """
    mask = np.zeros(view.changed.shape, np.bool_)
    for region in regions:
        _add_rectangle(mask, region.rectangle(view.camera, margin_px))
    return mask if view.frame.mask is None else mask & view.frame.mask


def _seen(gaussian_map: GaussianMap, targets: Iterable[Target], threads: int) -> Bools:
    """[N] which Gaussians have to do with the pixels that are compared."""
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    seen = np.zeros(gaussian_map.size, np.bool_)
    for target in targets:
        images = rasterizer.forward(gaussian_map, target.camera, options, mask=target.mask)
        seen[rasterizer.backward(dL_dalpha=np.zeros_like(images.alpha)).rows] = True
    return seen


def _of(gradients: Gradients, moving: Bools) -> Gradients:
    """Those of Gaussians that may move."""
    kept = moving[gradients.rows]
    if kept.all():
        return gradients
    parts = {}
    for one in fields(Gradients):
        array = getattr(gradients, one.name)
        if one.name != "dL_dtwist" and array is not None:
            parts[one.name] = array[kept]
    return replace(gradients, **parts)


def _rates(config: RefineConfig, share: float) -> AdamRates:
    left = config.rates_left**share
    return AdamRates(
        means=config.means_rate * left,
        quats=config.quats_rate * left,
        log_scales=config.log_scales_rate * left,
        logit_opacities=config.logit_opacities_rate * left,
        sh_dc=config.sh_rate * left,
        sh_rest=config.sh_rate * left / 20,
    )


def _by_round(losses: Sequence[float], steps: int) -> list[float]:
    """Means over each whole round of so many steps."""
    whole = len(losses) // steps * steps
    means = np.reshape(losses[:whole], (-1, steps)).mean(axis=1)
    return [float(mean) for mean in means]


def _settled(losses: Sequence[float], config: RefineConfig) -> bool:
    """Whether the error fell too little in the last rounds."""
    if len(losses) <= config.patience:
        return False
    before, after = min(losses[: -config.patience]), min(losses[-config.patience :])
    return after > before * (1 - config.least_gain)
