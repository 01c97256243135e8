"""How well a map shows frames that it was not made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.core.se3 import se3_retract, twist_of
from gslts.localization.alignment import align_pose
from gslts.mapping.observation import Observation
from gslts.rendering.losses import apply_exposure, fit_exposure
from gslts.rendering.metrics import psnr_db, ssim
from gslts.rendering.rasterizer import Images, Rasterizer, RenderOptions

POSE_LEVELS, POSE_STEPS = (1, 0), 4
"""Resolutions at which a pose is refined, and how many steps each takes."""


@dataclass(frozen=True)
class Quality:
    """Means over frames, with the exposure of each fitted.

    Attributes:
        frames: How many were compared.
        psnr_db: Of the colours.
        ssim: Structural similarity of the colours.
        depth_l1_m: Of the depth where it was measured; None without any.
    """

    frames: int
    psnr_db: float
    ssim: float
    depth_l1_m: float | None


@dataclass(frozen=True)
class HeldOut:
    """Three ways to judge a map by frames that it was not made from.

    Poses of a real data set err by centimetres, and the map is in the frame of the corrected ones:
    judged with the given poses, a sharp map looks worse than a blurred one.

    Attributes:
        given: With the poses of the data set.
        by_neighbours: With these moved as the frames before and after were, which uses nothing of
            the frame itself; None if its neighbours are not known.
        refined: With the poses fitted to the map, which is a little optimistic.
    """

    given: Quality
    by_neighbours: Quality | None
    refined: Quality


def evaluate(
    gaussian_map: GaussianMap, observations: Sequence[Observation], threads: int = 0, level: int = 0
) -> Quality:
    """Renders the map at the observations' poses and compares.

    Args:
        gaussian_map: float32.
        observations: At least one.
        threads: 0 means one a hardware thread.
        level: Of the resolution.

    Raises:
        ValueError: There is no observation.
    """
    if not observations:
        raise ValueError("evaluate: there is no frame")
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    psnrs_db, ssims, depth_l1_m = [], [], []
    for one in observations:
        images = rasterizer.forward(gaussian_map, one.camera(level), options)
        photo, mask, measured = one.photo(level), one.mask(level), one.depth(level)
        exposure = fit_exposure(images.rgb, photo, mask=mask, threads=threads)
        psnrs_db.append(psnr_db(apply_exposure(images.rgb, exposure), photo, mask))
        ssims.append(ssim(images.rgb, photo, mask, exposure=exposure, threads=threads))
        both = (measured > 0) & (images.depth > 0)
        if both.any():
            depth_l1_m.append(np.abs(images.depth - measured)[both].mean())
    return Quality(
        frames=len(psnrs_db),
        psnr_db=float(np.mean(psnrs_db)),
        ssim=float(np.mean(ssims)),
        depth_l1_m=float(np.mean(depth_l1_m)) if depth_l1_m else None,
    )


def evaluate_held_out(
    gaussian_map: GaussianMap,
    observations: Sequence[Observation],
    neighbours: Sequence[Sequence[Observation]],
    threads: int = 0,
) -> tuple[HeldOut, list[Observation]]:
    """Judges in all three ways.

    Args:
        gaussian_map: float32.
        observations: That the map was not made from; at least one.
        neighbours: For each, those of the frames next to it that the map was made from.
        threads: 0 means one a hardware thread.

    Returns:
        The judgement, and the observations at their refined poses.
    """
    given = [replace(one, pose=one.given_pose) for one in observations]
    moved_along = [
        near_by(one, near) for one, near in zip(observations, neighbours, strict=True) if near
    ]
    starts = moved_along if len(moved_along) == len(observations) else given
    refined = [refine_pose(gaussian_map, one, threads) for one in starts]
    return (
        HeldOut(
            given=evaluate(gaussian_map, given, threads),
            by_neighbours=evaluate(gaussian_map, moved_along, threads) if moved_along else None,
            refined=evaluate(gaussian_map, refined, threads),
        ),
        refined,
    )


def near_by(observation: Observation, neighbours: Sequence[Observation]) -> Observation:
    """The observation, its given pose corrected as those of its neighbours were on average."""
    twist = np.mean([twist_of(near.correction) for near in neighbours], axis=0)
    return replace(observation, pose=se3_retract(observation.given_pose, twist))


def refine_pose(
    gaussian_map: GaussianMap, observation: Observation, threads: int = 0
) -> Observation:
    """The observation at the pose nearby where the map fits it best."""
    frames = [observation.rgbd(level) for level in POSE_LEVELS]
    return replace(observation, pose=align_pose(gaussian_map, frames, POSE_STEPS, threads=threads))


def shown(images: Images, observation: Observation, threads: int = 0) -> FloatArray:
    """[H,W,3] what the map shows, as the photograph was exposed."""
    photo, mask = observation.photo(), observation.mask()
    return apply_exposure(images.rgb, fit_exposure(images.rgb, photo, mask=mask, threads=threads))
