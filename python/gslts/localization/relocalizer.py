"""Where in a map a picture was taken, and how far that can be trusted.

Corners of the picture give poses that may be, the rendering of the map at each sorts them out, and
the best one is refined until rendering and picture agree (iComMa, Sun et al. 2023; GS-LTS,
"Application in Real-world Robot System"). What is not certain is said to be so.
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
from gslts.localization.image_pyramid import Pictures
from gslts.localization.landmark_files import read_landmarks
from gslts.localization.landmarks import Landmarks, grey_of
from gslts.localization.pose_quality import (
    covariance_of,
    fault_of_corners,
    fault_of_covariance,
    fault_of_fit,
    trust_of,
)
from gslts.store.map_folder import read_map
from gslts.types import Floats

Status = Literal["ok", "ambiguous", "lost"]

COARSE_LEVELS = 2
"""Resolutions, of the coarsest ones, at which hypotheses are compared."""
STEP_M = 1e-3
"""A step of the refinement that is shorter is its last one at full size, and twice as much at half
of it: a third of what the map itself is off."""
APART_M, APART_RAD = 0.10, np.deg2rad(5)
"""Poses that are farther apart are different places."""
LIKELIER = 0.85
"""Another place whose fit is so many times as good as the best one makes a pose ambiguous."""
WORST_NEAR = 0.8
"""Share of depths near the map's below which depth is registered with its surfaces first."""


@dataclass(frozen=True, eq=False)
class Localization:
    """Where a picture was taken.

    Attributes:
        status: `ok`: there; `ambiguous`: there or elsewhere; `lost`: nobody knows.
        reason: Why it is not `ok`; empty if it is.
        world_from_camera: [4,4] the best pose; None if lost.
        covariance: [6,6] of a twist (rho, phi) of world_from_camera @ exp(rho, phi), m and rad, in
            the camera frame; None if lost.
        inliers: Corners that support the pose; 0 when tracking, which needs none.
        residual: Of the refinement: mean robust cost of a pixel, 0 to about 0.5; NaN if lost.
        fit: How well the picture fits the map there; None if there was no pose to try.
        others: Other poses that fit nearly as well.
        coarse: [4,4] the pose before its refinement; None if there was none.
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
    """Finds out where in one version of a map pictures were taken.

    Args:
        gaussian_map: float32.
        landmarks: Of the map; None means that it has none, and only tracking works.
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
    def of_map(cls, path: Path, config: RelocalizationConfig | None = None) -> Relocalizer:
        """Of a map folder, or a version of it such as MAP@3.

        Raises:
            OSError: A file cannot be read.
            ValueError: It is no map, or damaged.
        """
        gaussian_map = read_map(path)
        return cls(gaussian_map, read_landmarks(path, gaussian_map), config)

    @property
    def gaussian_map(self) -> GaussianMap:
        """In which it looks."""
        return self._map

    def locate(self, frame: RgbdFrame) -> Localization:
        """Finds a frame from nothing.

        Args:
            frame: Its pose does not count; depth may be missing.
        """
        if self._index is None:
            return _lost("the map has no landmarks; gslts map makes maps that do")
        pictures = self._pictures(frame)
        found = self._hypotheses(pictures)
        if not found:
            return _lost("too few corners of the picture are in the map")
        levels = pictures.levels(self.config.halvings)
        tried = [
            self._tried(pictures, one, levels[:COARSE_LEVELS])
            for one in found[: self.config.hypotheses]
        ]
        tried.sort(key=lambda one: -one.trust)
        best = tried[0]
        pose = self._refined(pictures, best.pose, levels[COARSE_LEVELS:] or levels[-1:])
        others: list[Floats] = []
        for one in tried[1:]:
            is_new = all(_are_apart(one.pose, other) for other in (best.pose, *others))
            if is_new and one.trust > LIKELIER * best.trust:
                others.append(one.pose)
        return self._told(pictures, pose, best.inliers, tuple(others), best.coarse)

    def track(self, frame: RgbdFrame, world_from_camera: Floats) -> Localization:
        """Finds a frame near a pose, such as that of the frame before.

        Args:
            frame: Its pose does not count; depth may be missing.
            world_from_camera: [4,4] that is some centimetres and degrees off at most.

        Raises:
            ValueError: The pose is not rigid.
        """
        pictures = self._pictures(frame)
        pose = self._refined(pictures, world_from_camera, pictures.levels(self.config.halvings))
        return self._told(pictures, pose, None, (), world_from_camera)

    def _pictures(self, frame: RgbdFrame) -> Pictures:
        return Pictures.of(frame, use_depth=self.config.use_depth)

    def _hypotheses(self, pictures: Pictures) -> list[_core.Hypothesis]:
        frame, depth = pictures.frames[0], pictures.depths[0]
        rule = _core.FeatureRule(count=self.config.corners)
        pixels, descriptors = _core.features_of(grey_of(frame.rgb), frame.mask, rule)
        columns, rows = np.floor(pixels).astype(np.intp).T
        depths = np.ascontiguousarray(depth[rows, columns])
        assert self._index is not None
        return _core.hypotheses_of(
            frame.camera, pixels, descriptors, depths, self._index, _core.HypothesisRule()
        )

    def _tried(
        self, pictures: Pictures, hypothesis: _core.Hypothesis, levels: Sequence[int]
    ) -> _Tried:
        """A hypothesis after a look at the map, and how far it can be trusted."""
        start = np.array(hypothesis.world_from_camera)
        start[:3, 3] += self._map.origin  # Landmarks are relative to it.
        pose = self._refined(pictures, start, levels)
        far = pose.fit.near < WORST_NEAR or self.config.iterations == 0
        if self.config.register_clouds and pictures.has_depth and far:
            registered = self._surface.registered(pictures, start)
            again = self._refined(pictures, registered, levels)
            if trust_of(again.fit, True) > trust_of(pose.fit, True):
                pose = again
        trust = trust_of(pose.fit, pictures.has_depth)
        return _Tried(pose.world_from_camera, trust, start, hypothesis.inliers)

    def _refined(
        self, pictures: Pictures, start: Floats, levels: Sequence[int]
    ) -> _core.RefinedPose:
        config = self.config
        cameras = [at_pose(pictures.frames[level].camera, start) for level in levels]
        thinned = [*levels[:-1], 0]  # The last one tells how well the picture fits the whole map.
        return _core.refine_pose(
            [self._maps.halved(level) for level in thinned],
            cameras,
            [pictures.photos[level] for level in levels],
            measured=[pictures.depths[level] for level in levels],
            masks=[pictures.spread(level) for level in levels],
            rule=_core.RefineRule(
                iterations=config.iterations, min_step_m=STEP_M, threads=config.threads
            ),
        )

    def _told(
        self,
        pictures: Pictures,
        pose: _core.RefinedPose,
        inliers: int | None,
        others: tuple[Floats, ...],
        coarse: Floats,
    ) -> Localization:
        """What becomes of a refined pose; one that was tracked needs no corners."""
        covariance = covariance_of(pose)
        fault = fault_of_fit(pose.fit, pictures.has_depth)
        if inliers is not None:
            fault = fault or fault_of_corners(inliers, pose.fit, pictures.has_depth)
        fault = fault or fault_of_covariance(covariance)
        if fault is not None:
            return Localization(status="lost", reason=fault, fit=pose.fit, coarse=coarse)
        return Localization(
            status="ambiguous" if others else "ok",
            reason=f"{len(others)} other place(s) look nearly the same" if others else "",
            world_from_camera=pose.world_from_camera,
            covariance=covariance,
            inliers=inliers or 0,
            residual=pose.cost,
            fit=pose.fit,
            others=others,
            coarse=coarse,
        )


@dataclass(frozen=True, eq=False)
class _Tried:
    pose: Floats
    trust: float
    coarse: Floats
    inliers: int


def _lost(reason: str) -> Localization:
    return Localization(status="lost", reason=reason)


def _are_apart(first: Floats, second: Floats) -> bool:
    metres, turn_rad = pose_distance(first, second)
    return metres > APART_M or turn_rad > APART_RAD
