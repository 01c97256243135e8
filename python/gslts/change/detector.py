"""What one RGB-D frame shows that a map does not, and the other way round."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gslts._core import detect as _core
from gslts.change.changes import Change, object_changes, paper_change
from gslts.change.config import MOST_HALVINGS, DetectionConfig
from gslts.change.exposure import robust_exposure
from gslts.change.features import FeatureExtractor, OrientedGradients, similarity
from gslts.change.reliability import (
    MOST_CHANGED,
    MOST_SHIFT_M,
    MOST_TURN_RAD,
    fault_of_frame,
    fault_of_likeness,
    fault_of_view,
)
from gslts.change.visibility import SeenSpace
from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import pose_distance
from gslts.localization.alignment import aligned
from gslts.rendering.losses import Exposure, apply_exposure
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Bools, Floats

ALIGN_STEPS = 3
"""Of the pose, at each resolution from a quarter of the frame's."""
POSE_STDS = (0.01, 0.0087)
"""How far a robot's pose is expected to be off, m and rad (half a degree)."""
NEAR_SIGMAS = 6.0
"""Gaussians nearer than so many of their standard deviations are left out: beside the camera the
map is better unknown than blurred."""

MOST_CAMERAS = 200
"""A map that lives has ever more of them, and how certain changes are was fitted to maps of as many
frames."""


@dataclass(frozen=True, eq=False)
class Detection:
    """What one frame tells.

    Attributes:
        changes: The most certain first; none if the frame is unreliable.
        unreliable: Why nothing can be said; None if something can.
        camera: Of the images below, at the corrected pose.
        photo: [H,W,3] float32 sRGB, 0 to 1.
        render: [H,W,3] float32, the map with the exposure of the photo; None if unreliable.
        pixel, feature, combined: [H,W] M_pixel, M_feat and M_comb; None if unreliable.
        exposure: From the map's colours to those of the photo.
        surfaces: All that changes are made of, likely or not; none with the strategy "paper".
        labels: [H,W] int32 of them, 0 where there is none; None if unreliable.
    """

    changes: tuple[Change, ...]
    unreliable: str | None
    camera: Camera
    photo: NDArray[np.float32]
    render: NDArray[np.float32] | None = None
    pixel: Bools | None = None
    feature: Bools | None = None
    combined: Bools | None = None
    exposure: Exposure = field(default_factory=Exposure)
    surfaces: tuple[_core.Surface, ...] = ()
    labels: NDArray[np.int32] | None = None


class ChangeDetector:
    """Compares frames with one version of a map; may be used by several threads in turn.

    Args:
        gaussian_map: float32.
        config: Settings.
        features: None means `OrientedGradients`.
        cameras: Of the frames that the map was made from: what none of them saw cannot have
            changed. None of them means that everything was seen; of more than `MOST_CAMERAS`, an
            even share counts.

    Raises:
        ValueError: The map is not float32.
    """

    def __init__(
        self,
        gaussian_map: GaussianMap,
        config: DetectionConfig | None = None,
        *,
        features: FeatureExtractor | None = None,
        cameras: Iterable[Camera] = (),
    ) -> None:
        if gaussian_map.dtype != np.float32:
            raise ValueError(f"ChangeDetector: the map must be float32, got {gaussian_map.dtype}")
        self.config = DetectionConfig() if config is None else config
        self._map = gaussian_map
        self._features = OrientedGradients() if features is None else features
        self._seen = SeenSpace(gaussian_map, evenly(tuple(cameras)), self.config.threads)
        self._rasterizer = Rasterizer(np.float32)

    @property
    def gaussian_map(self) -> GaussianMap:
        """What frames are compared with."""
        return self._map

    def with_map(self, gaussian_map: GaussianMap, cameras: Iterable[Camera]) -> ChangeDetector:
        """Makes a detector with the same settings for another map.

        Args:
            gaussian_map: float32.
            cameras: Of the frames that it was made from.

        Raises:
            ValueError: The map is not float32.
        """
        return ChangeDetector(gaussian_map, self.config, features=self._features, cameras=cameras)

    def detect(self, frame: RgbdFrame) -> Detection:
        """Looks for changes.

        Raises:
            ValueError: A setting is out of range, or the frame is too small to be halved.
        """
        sizes = [frame.registered()]
        for _ in range(MOST_HALVINGS):
            sizes.append(sizes[-1].halved())
        small = sizes[self.config.halvings]
        photo = small.rgb.astype(np.float32) / np.float32(255)
        measured = np.nan_to_num(small.depth)
        fault = frame.fault or fault_of_frame(photo, measured)
        if fault is not None:
            return Detection((), fault, small.camera, photo)
        camera = small.camera
        if self.config.align_pose:
            coarse_first = reversed(sizes[self.config.halvings :])
            pose = aligned(
                self._map,
                coarse_first,
                ALIGN_STEPS,
                stds=POSE_STDS,
                threads=self.config.threads,
            )
            camera = at_pose(camera, pose)
            fault = _fault_of_correction(small.camera.world_from_camera, pose)
            if fault is not None:
                return Detection((), fault, small.camera, photo)
        return self._compared(photo, measured, camera, small.mask)

    def _compared(
        self,
        photo: NDArray[np.float32],
        measured: NDArray[np.float32],
        camera: Camera,
        mask: Bools | None,
    ) -> Detection:
        config = self.config
        options = RenderOptions(near_sigmas=NEAR_SIGMAS, threads=config.threads)
        images = self._rasterizer.forward(self._map, camera, options)
        alpha = images.alpha if mask is None else np.where(mask, images.alpha, np.float32(0))
        known = alpha >= config.masks.alpha_min
        exposure = robust_exposure(images.rgb, photo, known, config.threads)
        rgb = apply_exposure(images.rgb, exposure)
        rgb = rgb.clip(0, 1).astype(np.float32)
        fault = fault_of_view(photo, rgb, measured, images.depth, known)
        if fault is not None:
            return Detection((), fault, camera, photo)
        alike = similarity(self._features(photo), self._features(rgb), *photo.shape[:2])
        fault = fault_of_likeness(alike, known)
        if fault is not None:
            return Detection((), fault, camera, photo)
        views = _core.Views(
            camera=camera,
            observed_rgb=photo,
            rendered_rgb=rgb,
            observed_depth=measured,
            rendered_depth=images.depth,
            alpha=np.ascontiguousarray(alpha),
            similarity=alike,
        )
        masks = _core.compute_masks(views, config.masks)
        arrays = _core.mask_arrays(masks, camera)
        changes, surfaces, labels = self._changes(views, masks)
        changed = [one for change in changes for one in change.masks if one is not None]
        if changed and np.any(changed, axis=0).sum() > MOST_CHANGED * known.sum():
            return Detection((), "most of the view differs", camera, photo)
        return Detection(
            changes=changes,
            unreliable=None,
            camera=camera,
            photo=photo,
            render=rgb,
            pixel=arrays["pixel"],
            feature=arrays["feature"],
            combined=arrays["combined"],
            exposure=exposure,
            surfaces=surfaces,
            labels=labels,
        )

    def _changes(
        self, views: _core.Views, masks: _core.Masks
    ) -> tuple[tuple[Change, ...], tuple[_core.Surface, ...], NDArray[np.int32]]:
        """The changes, the surfaces that they are made of, and the labels of either."""
        if self.config.strategy == "paper":
            change, labels = _core.detect_gs_lts(views, masks, self.config.paper)
            return () if change is None else (paper_change(change, labels),), (), labels
        found, labels = _core.find_changed_surfaces(views, masks, self.config.objects)
        for one in found:
            one.visibility = self._sights(one)
        return object_changes(found, labels, self.config.objects), tuple(found), labels

    def _sights(self, surface: _core.Surface) -> _core.Visibility | None:
        """What tells the map's own errors, and what it never knew, from changes."""
        if not self._seen.is_known:
            return None
        sights = self._seen.sights(np.array(surface.samples))
        seen = sights.on + sights.through > 0
        return _core.Visibility(
            on_surface=sights.on.sum(),
            seen_through=sights.through.sum(),
            known_share=float(seen.mean()),
        )


def evenly(cameras: Sequence[Camera]) -> list[Camera]:
    """`MOST_CAMERAS` of some cameras, or all of them if they are fewer."""
    count = min(len(cameras), MOST_CAMERAS)
    return [cameras[k] for k in np.linspace(0, len(cameras) - 1, count).round().astype(int)]


def _fault_of_correction(given: Floats, pose: Floats) -> str | None:
    shift_m, turn_rad = pose_distance(given, pose)
    if shift_m <= MOST_SHIFT_M and turn_rad <= MOST_TURN_RAD:
        return None
    return f"the pose seems off by {shift_m:.2f} m and {np.degrees(turn_rad):.0f} degrees"
