"""Relocalization: the 6-DoF pose of a single image in a map, without a prior.

Keypoints matched with the landmarks of the map give pose hypotheses, renderings of the map at each
rank them, and the best one is refined until rendering and image agree (iComMa, Sun et al. 2023;
GS-LTS, "Application in Real-world Robot System").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from gslts._core import reloc as _core
from gslts.core.camera import at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import pose_distance
from gslts.localization.clouds import SurfaceCloud
from gslts.localization.coarse_maps import CoarseMaps
from gslts.localization.config import RelocalizationConfig
from gslts.localization.constants import (
    AMBIGUOUS_RATIO,
    COARSE_LEVELS,
    MIN_STEP_M,
    REGISTER_BELOW_NEAR,
    SAME_POSE_M,
    SAME_POSE_RAD,
)
from gslts.localization.image_pyramid import ImagePyramid
from gslts.localization.landmark_extraction import gray_image
from gslts.localization.landmark_files import read_landmarks
from gslts.localization.landmarks import Landmarks
from gslts.localization.pose_quality import (
    agreement_fault,
    covariance_fault,
    fit_score,
    inlier_fault,
    pose_covariance,
)
from gslts.rendering.view_range import view_range_m
from gslts.store.map_folder import read_map
from gslts.types import Floats

Status = Literal["ok", "ambiguous", "lost"]


@dataclass(frozen=True, eq=False)
class Localization:
    """Estimated pose of an image in a map.

    Attributes:
        status: "ok"; "ambiguous" if other poses fit nearly as well; "lost" if none is accepted.
        reason: Reason why it is not "ok"; empty if it is.
        world_from_camera: [4,4] best pose, m; None if lost.
        covariance: [6,6] of a twist (rho, phi) of world_from_camera @ exp(rho, phi), m and rad, in
            the camera frame; None if lost.
        inliers: Number of keypoints that support the pose; 0 when tracking, which uses none.
        residual: Mean robust cost per pixel of the refinement, 0 to about 0.5; NaN if lost.
        fit: Agreement of image and map at the pose; None if there was no hypothesis.
        others: [4,4] other poses that fit nearly as well.
        coarse: [4,4] pose before its refinement; None if there was no hypothesis.
    """

    status: Status
    reason: str
    world_from_camera: Floats | None = None
    covariance: Floats | None = None
    inliers: int = 0
    residual: float = float("nan")
    fit: _core.Fit | None = None
    others: tuple[Floats, ...] = ()
    coarse: Floats | None = None


class Relocalizer:
    """Estimates the pose of single images in one version of a map.

    Args:
        gaussian_map: float32.
        landmarks: Landmarks of the map; None means that only tracking works.
        config: Settings; None means the defaults.

    Raises:
        ValueError: The map is not float32.
    """

    def __init__(
        self,
        gaussian_map: GaussianMap,
        landmarks: Landmarks | None,
        config: RelocalizationConfig | None = None,
    ) -> None:
        if gaussian_map.dtype != np.float32:
            raise ValueError(f"Relocalizer: the map must be float32, got {gaussian_map.dtype}")
        self.config = RelocalizationConfig() if config is None else config
        self._map, self._maps = gaussian_map, CoarseMaps(gaussian_map)
        self._surface = SurfaceCloud(gaussian_map)
        self._index = None
        if landmarks is not None and landmarks.size > 0:
            self._index = _core.LandmarkIndex(
                landmarks.positions, landmarks.descriptors, landmarks.keyframes
            )

    @classmethod
    def of_map(cls, path: Path | str, config: RelocalizationConfig | None = None) -> Relocalizer:
        """Read the Gaussians and the landmarks of a map.

        Args:
            path: Map folder, or a version of it such as MAP@3.
            config: Settings; None means the defaults.

        Raises:
            OSError: A file cannot be read.
            ValueError: The path is no map, or the map is damaged.
        """
        path = Path(path)
        gaussian_map = read_map(path)
        return cls(gaussian_map, read_landmarks(path, gaussian_map), config)

    @property
    def gaussian_map(self) -> GaussianMap:
        """The map in which images are localized."""
        return self._map

    def localize(self, frame: RgbdFrame) -> Localization:
        """Localize a frame without a prior.

        Args:
            frame: Its pose is not used; depth may be missing.
        """
        if self._index is None:
            return _lost_because("the map has no landmarks; gslts map makes maps that do")
        pyramid = self._pyramid(frame)
        hypotheses = self._hypotheses(pyramid)
        if not hypotheses:
            return _lost_because("too few keypoints of the image match the map")
        levels = pyramid.levels(self.config.halvings)
        candidates = [
            self._candidate(pyramid, hypothesis, levels[:COARSE_LEVELS])
            for hypothesis in hypotheses[: self.config.hypotheses]
        ]
        candidates.sort(key=lambda candidate: -candidate.score)
        best = candidates[0]
        pose = self._refine(pyramid, best.pose, levels[COARSE_LEVELS:] or levels[-1:])
        others: list[Floats] = []
        for candidate in candidates[1:]:
            is_new = all(_differ(candidate.pose, other) for other in (best.pose, *others))
            if is_new and candidate.score > AMBIGUOUS_RATIO * best.score:
                others.append(candidate.pose)
        return self._judge(pyramid, pose, best.inliers, tuple(others), best.coarse)

    def track(self, frame: RgbdFrame, world_from_camera: Floats) -> Localization:
        """Localize a frame near a predicted pose, such as that of the previous frame.

        Args:
            frame: Its pose is not used; depth may be missing.
            world_from_camera: [4,4] predicted pose, m, some centimetres and degrees off at most.

        Raises:
            ValueError: The pose is not rigid.
        """
        pyramid = self._pyramid(frame)
        pose = self._refine(pyramid, world_from_camera, pyramid.levels(self.config.halvings))
        return self._judge(pyramid, pose, None, (), world_from_camera)

    def _pyramid(self, frame: RgbdFrame) -> ImagePyramid:
        return ImagePyramid.of(frame, use_depth=self.config.use_depth)

    def _hypotheses(self, pyramid: ImagePyramid) -> list[_core.Hypothesis]:
        """Return poses from matches of keypoints and landmarks, relative to the map's origin."""
        frame, depth = pyramid.frames[0], pyramid.depths[0]
        rule = _core.FeatureRule(count=self.config.keypoints)
        pixels, descriptors = _core.features_of(gray_image(frame.rgb), frame.mask, rule)
        columns, rows = np.floor(pixels).astype(np.intp).T
        depths = np.ascontiguousarray(depth[rows, columns])
        assert self._index is not None
        return _core.hypotheses_of(
            frame.camera, pixels, descriptors, depths, self._index, _core.HypothesisRule()
        )

    def _candidate(
        self, pyramid: ImagePyramid, hypothesis: _core.Hypothesis, levels: Sequence[int]
    ) -> _Candidate:
        """Refine and score a hypothesis at coarse resolutions."""
        start = np.array(hypothesis.world_from_camera)
        start[:3, 3] += self._map.origin  # Landmarks are relative to it.
        pose = self._refine(pyramid, start, levels)
        is_off = pose.fit.near < REGISTER_BELOW_NEAR or self.config.iterations == 0
        if self.config.register_clouds and pyramid.has_depth and is_off:
            registered = self._surface.register(pyramid, start)
            again = self._refine(pyramid, registered, levels)
            if fit_score(again.fit, True) > fit_score(pose.fit, True):
                pose = again
        score = fit_score(pose.fit, pyramid.has_depth)
        return _Candidate(pose.world_from_camera, score, start, hypothesis.inliers)

    def _refine(
        self, pyramid: ImagePyramid, start: Floats, levels: Sequence[int]
    ) -> _core.RefinedPose:
        """Refine a pose at some resolutions by inverting the rendering."""
        config = self.config
        cameras = [at_pose(pyramid.frames[level].camera, start) for level in levels]
        thinned = [*levels[:-1], 0]  # The last one judges the agreement with the full map.
        return _core.refine_pose(
            [self._maps.for_level(level) for level in thinned],
            cameras,
            [pyramid.colors[level] for level in levels],
            measured=[pyramid.depths[level] for level in levels],
            masks=[pyramid.used_pixels(level) for level in levels],
            rule=_core.RefineRule(
                iterations=config.iterations,
                min_step_m=MIN_STEP_M,
                far_m=view_range_m(pyramid.depths[0]),
                threads=config.threads,
            ),
        )

    def _judge(
        self,
        pyramid: ImagePyramid,
        pose: _core.RefinedPose,
        inliers: int | None,
        others: tuple[Floats, ...],
        coarse: Floats,
    ) -> Localization:
        """Accept or reject a refined pose; `inliers` is None for a tracked one."""
        covariance = pose_covariance(pose)
        fault = agreement_fault(pose.fit, pyramid.has_depth)
        if inliers is not None:
            fault = fault or inlier_fault(inliers, pose.fit, pyramid.has_depth)
        fault = fault or covariance_fault(covariance)
        if fault is not None:
            return Localization(status="lost", reason=fault, fit=pose.fit, coarse=coarse)
        return Localization(
            status="ambiguous" if others else "ok",
            reason=f"{len(others)} other pose(s) fit nearly as well" if others else "",
            world_from_camera=pose.world_from_camera,
            covariance=covariance,
            inliers=inliers or 0,
            residual=pose.cost,
            fit=pose.fit,
            others=others,
            coarse=coarse,
        )


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A hypothesis refined at coarse resolutions: poses [4,4] after and before, score, inliers."""

    pose: Floats
    score: float
    coarse: Floats
    inliers: int


def _lost_because(reason: str) -> Localization:
    return Localization(status="lost", reason=reason)


def _differ(first: Floats, second: Floats) -> bool:
    """Test if two poses [4,4] are different hypotheses."""
    metres, turn_rad = pose_distance(first, second)
    return metres > SAME_POSE_M or turn_rad > SAME_POSE_RAD
