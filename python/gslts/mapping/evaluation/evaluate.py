"""PSNR, SSIM and depth error of a map on frames that it was not trained on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np

from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.localization.alignment import align_pose
from gslts.mapping.frames import HeldOutFrames
from gslts.mapping.observation import Observation
from gslts.rendering.losses import apply_exposure, fit_exposure
from gslts.rendering.metrics import psnr_db, ssim
from gslts.rendering.rasterizer import Images, Rasterizer, RenderOptions


@dataclass(frozen=True)
class Quality:
    """Means over frames, with the exposure of each frame fitted.

    Attributes:
        frames: Number of frames.
        psnr_db: PSNR of the colours, dB.
        ssim: Structural similarity of the colours.
        depth_l1_m: Mean absolute depth error where depth was measured, m; None without depth.
    """

    frames: int
    psnr_db: float
    ssim: float
    depth_l1_m: float | None


@dataclass(frozen=True)
class HeldOutQuality:
    """Quality on held-out frames, for three choices of their poses.

    Given poses of real data err by centimetres, and the map lies in the frame of the refined ones:
    at given poses, a sharp map looks worse than a blurred one.

    Attributes:
        given: At the poses of the data set.
        by_neighbours: At these, corrected by the mean correction of the training frames before and
            after, which uses no pixel of the frame itself; None if no neighbour is known.
        refined: At poses aligned with the map, which is slightly optimistic.
    """

    given: Quality
    by_neighbours: Quality | None
    refined: Quality


def evaluate(
    gaussian_map: GaussianMap, observations: Sequence[Observation], threads: int = 0, level: int = 0
) -> Quality:
    """Compare renderings with frames at the current poses of these.

    Args:
        gaussian_map: float32.
        observations: At least one frame that shows something in its mask; others are left out.
        threads: Number of threads; 0 means all.
        level: Resolution; 0 is the full one.

    Raises:
        ValueError: There is no such frame.
    """
    masks = [observation.mask(level) for observation in observations]
    shown = [mask is None or bool(mask.any()) for mask in masks]
    if not any(shown):
        raise ValueError("evaluate: there is no frame")
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    psnrs_db, ssims, depth_errors_m = [], [], []
    for observation in compress(observations, shown):
        images = rasterizer.forward(gaussian_map, observation.camera(level), options)
        photo, mask = observation.color(level), observation.mask(level)
        exposure = fit_exposure(images.rgb, photo, mask=mask, threads=threads)
        psnrs_db.append(psnr_db(apply_exposure(images.rgb, exposure), photo, mask))
        ssims.append(ssim(images.rgb, photo, mask, exposure=exposure, threads=threads))
        measured = observation.depth(level)
        both = (measured > 0) & (images.depth > 0)
        if both.any():
            depth_errors_m.append(np.abs(images.depth - measured)[both].mean())
    return Quality(
        frames=len(psnrs_db),
        psnr_db=float(np.mean(psnrs_db)),
        ssim=float(np.mean(ssims)),
        depth_l1_m=float(np.mean(depth_errors_m)) if depth_errors_m else None,
    )


def evaluate_held_out(
    gaussian_map: GaussianMap, frames: HeldOutFrames, threads: int = 0
) -> tuple[HeldOutQuality, dict[str, Observation]]:
    """Evaluate a map at given, corrected and refined poses.

    Args:
        gaussian_map: float32.
        frames: Frames that the map was not trained on; at least one.
        threads: Number of threads; 0 means all.

    Returns:
        The quality, and the frames at refined poses by name.

    Raises:
        ValueError: There is no frame.
    """
    given = [frame.at_pose(frame.given_pose) for frame in frames.observations.values()]
    corrected = frames.by_neighbours()
    starts = corrected if len(corrected) == len(given) else given
    refined = [refine_pose(gaussian_map, frame, threads) for frame in starts]
    quality = HeldOutQuality(
        given=evaluate(gaussian_map, given, threads),
        by_neighbours=evaluate(gaussian_map, corrected, threads) if corrected else None,
        refined=evaluate(gaussian_map, refined, threads),
    )
    return quality, dict(zip(frames.observations, refined, strict=True))


def refine_pose(
    gaussian_map: GaussianMap, observation: Observation, threads: int = 0
) -> Observation:
    """Return an observation at the nearby pose that fits the map best.

    Args:
        gaussian_map: float32.
        observation: Frame at its initial pose.
        threads: Number of threads; 0 means all.
    """
    frames = [observation.rgbd(level) for level in (1, 0)]  # Coarse to fine.
    return observation.at_pose(align_pose(gaussian_map, frames, threads=threads))


def rgb_as_exposed(images: Images, observation: Observation, threads: int = 0) -> FloatArray:
    """Return rendered colours [H,W,3] with the exposure of a photograph fitted.

    Args:
        images: Rendered at the pose of the observation, in full resolution.
        observation: The photograph.
        threads: Number of threads; 0 means all.
    """
    exposure = fit_exposure(
        images.rgb, observation.color(), mask=observation.mask(), threads=threads
    )
    return apply_exposure(images.rgb, exposure)
