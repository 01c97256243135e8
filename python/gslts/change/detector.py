"""Detects object changes by comparing an RGB-D frame with a rendering of the map (GS-LTS III-C)."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from gslts._core import detect as _core
from gslts.change.blur import Detail
from gslts.change.changes import Change
from gslts.change.config import DetectionConfig
from gslts.change.constants import (
    ALIGNED_HALVINGS,
    MAX_CAMERAS,
    MAX_CHANGED_SHARE,
    MAX_WITNESS_SHARE,
    MIN_ERROR_ALPHA,
    MIN_MAP_WITNESSES,
    MIN_MEASURED_WEIGHT,
    MIN_WITNESSES,
    NEAR_SIGMAS,
    POSE_STDS,
)
from gslts.change.departures import are_in, expect_departures, find_added
from gslts.change.depth_quality import DepthQuality, depth_quality
from gslts.change.detection import Detection
from gslts.change.exposure import robust_exposure
from gslts.change.features import FeatureExtractor, OrientedGradients, similarity
from gslts.change.recorded import find_recorded
from gslts.change.reliability import (
    appearance_fault,
    correction_fault,
    depth_fault,
    frame_fault,
    view_fault,
)
from gslts.change.rules import gs_lts_change, object_changes, shift_change
from gslts.change.unknown import surface_fault, unknown_regions
from gslts.change.visibility import Visibility
from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.localization.alignment import align_pose
from gslts.rendering.losses import apply_exposure
from gslts.rendering.rasterizer import Images, Rasterizer, RenderOptions
from gslts.rendering.view_range import view_range_m
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import read_map, updates_of_map
from gslts.store.measurement_files import read_measurements
from gslts.store.measurements import NO_MEASUREMENTS, Measurements
from gslts.store.records import NO_UPDATES, Updates
from gslts.types import Bools, Floats32, Ints32


class ChangeDetector:
    """Detects changes between one version of a map and frames of the same home.

    Several threads may use it; they wait for each other.

    Args:
        gaussian_map: float32.
        config: Settings; None means the defaults.
        features: Feature extractor; None means `OrientedGradients`.
        cameras: Training cameras of the map: space that none of them saw cannot have changed.
            Without any, all space counts as seen. At most `MAX_CAMERAS`, evenly chosen, are used.
        measurements: What the recording of the map tells of its Gaussians. Changes of what no
            depth confirms cannot be judged; depth steps count from a multiple of the noise; and a
            surface that the recording measured is not new, one that it saw through not gone.
        updates: What updates changed since: what came is likelier to go than other things, and
            may come again where it left.

    Attributes:
        config: Settings.
        cameras: Training cameras of the map.

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
        measurements: Measurements = NO_MEASUREMENTS,
        updates: Updates = NO_UPDATES,
    ) -> None:
        if gaussian_map.dtype != np.float32:
            raise ValueError(f"ChangeDetector: the map must be float32, got {gaussian_map.dtype}")
        self.config = DetectionConfig() if config is None else config
        self._map, self._measurements = gaussian_map, measurements
        self._plain = gaussian_map.without_features()
        self._updates = updates
        self._left, self._came = (
            np.array([*boxes], np.float64).reshape(-1, 2, 3)
            for boxes in (updates.left, updates.came)
        )
        self._drawn = gaussian_map.with_features(
            lambda ids: np.column_stack(
                [
                    measurements.is_measured_of(ids),
                    measurements.errors_of(ids),
                    are_in(ids, updates.added_ids),
                ]
            ).astype(np.float32)
        )
        self._features = OrientedGradients() if features is None else features
        self.cameras = tuple(cameras)
        witnesses = choose_evenly(self.cameras, MAX_CAMERAS)
        self._visibility = Visibility(self._plain, witnesses, self.config.threads)
        share = math.ceil(MAX_WITNESS_SHARE * len(witnesses))
        self._min_witnesses = min(MIN_WITNESSES, share)
        self._rasterizer = Rasterizer(np.float32)
        self._in_use = threading.Lock()

    @classmethod
    def of_map(
        cls,
        path: Path | str,
        config: DetectionConfig | None = None,
        *,
        features: FeatureExtractor | None = None,
    ) -> ChangeDetector:
        """Read the Gaussians, the training cameras and the measurements of a map.

        Args:
            path: Map folder, a version of it such as MAP@3, or a PLY file, which has no cameras.
            config: Settings; None means the defaults.
            features: Feature extractor; None means `OrientedGradients`.

        Raises:
            OSError: A file cannot be read.
            ValueError: The path is no map, or the map is damaged.
        """
        path = Path(path)
        return cls(
            read_map(path),
            config,
            features=features,
            cameras=cameras_of_map(path).values(),
            measurements=read_measurements(path),
            updates=updates_of_map(path),
        )

    @property
    def gaussian_map(self) -> GaussianMap:
        """The map that frames are compared with."""
        return self._map

    def with_map(
        self, gaussian_map: GaussianMap, cameras: Iterable[Camera], since: Updates = NO_UPDATES
    ) -> ChangeDetector:
        """Return a detector with the same settings for an edited map.

        Args:
            gaussian_map: float32.
            cameras: Training cameras of that map.
            since: What was changed in this map to make it.

        Raises:
            ValueError: The map is not float32.
        """
        return ChangeDetector(
            gaussian_map,
            self.config,
            features=self._features,
            cameras=cameras,
            measurements=self._measurements,
            updates=self._updates.then(since),
        )

    def detect(self, frame: RgbdFrame) -> Detection:
        """Compare a frame with the map.

        Args:
            frame: Its pose may err by some centimetres and degrees; it is aligned first. Without
                fine depth colours decide, with what coarse depth tells of whole regions.

        Raises:
            ValueError: A setting is out of range, or the frame is too small to be halved.
        """
        with self._in_use:
            return self._detect(frame)

    def _detect(self, frame: RgbdFrame) -> Detection:
        pyramid = [frame.registered()]
        halvings = self.config.halvings_of(frame.camera.width)
        for _ in range(halvings + ALIGNED_HALVINGS):
            pyramid.append(pyramid[-1].halved())
        small = pyramid[halvings]
        camera = small.camera
        observed_rgb = small.rgb.astype(np.float32) / np.float32(255)
        observed_depth = np.nan_to_num(small.depth)
        mask = np.ones(observed_depth.shape, np.bool_) if small.mask is None else small.mask
        depth = depth_quality(_within(pyramid[0].depth, pyramid[0].mask))
        fault = frame.fault or frame_fault(_within(observed_rgb, small.mask))
        if depth == "none" and self.config.strategy == "gs_lts":
            fault = fault or "hardly any depth is measured, which the rule of GS-LTS needs"
        if fault is None and self.config.align_pose:
            pose = align_pose(
                self._plain,
                reversed(pyramid[halvings:]),
                stds=POSE_STDS,
                threads=self.config.threads,
            )
            fault = correction_fault(camera.world_from_camera, pose)
            if fault is None:
                camera = at_pose(camera, pose)
        if fault is not None:
            return Detection((), fault, camera, observed_rgb)
        return self._compare(observed_rgb, observed_depth, camera, mask, depth)

    def _compare(
        self,
        observed_rgb: Floats32,
        observed_depth: Floats32,
        camera: Camera,
        mask: Bools,
        depth: DepthQuality,
    ) -> Detection:
        """Compare the images of a frame at its true pose with a rendering.

        Without fine depth colours decide, with what coarse depth tells of whole regions.
        """
        config = self.config
        options = RenderOptions(
            far_m=view_range_m(observed_depth), near_sigmas=NEAR_SIGMAS, threads=config.threads
        )
        images = self._rasterizer.forward(self._drawn, camera, options)
        alpha = np.where(mask, images.alpha, np.float32(0))
        known = alpha >= config.masks.alpha_min
        exposure = robust_exposure(images.rgb, observed_rgb, known, config.threads)
        rendered_rgb = apply_exposure(images.rgb, exposure).clip(0, 1).astype(np.float32)
        # Windows around pixels at the border of the mask must see no step there.
        compared_rgb = np.where(mask[..., None], observed_rgb, rendered_rgb)
        detail = Detail(compared_rgb, rendered_rgb, known)
        fault = view_fault(detail, known[mask])
        if fault is not None:
            return Detection((), fault, camera, observed_rgb)
        unknown = self._unknown_pixels(images, known, detail, depth)
        comparable = mask & ~np.any(list(unknown.values()), axis=0)
        features = self._features(compared_rgb), self._features(rendered_rgb)
        cosines = similarity(*features, *known.shape)
        fault = appearance_fault(features, cosines, comparable, depth)
        fault = fault or depth_fault(observed_depth, images.depth, comparable, depth)
        if fault is not None:
            return Detection((), fault, camera, observed_rgb)
        errors = self._expected_errors(images)
        views = _core.Views(
            camera=camera,
            observed_rgb=compared_rgb,
            rendered_rgb=rendered_rgb,
            observed_depth=observed_depth,
            rendered_depth=images.depth,
            alpha=np.where(comparable, alpha, np.float32(0)),
            similarity=cosines,
            noise=self._measurements.noise,
            **errors,
        )
        masks = _core.compute_masks(views, config.masks)
        changes, surfaces, labels = self._changes(views, masks, depth, _mean_drawn(images, 3))
        changed = [mask for change in changes for mask in change.masks if mask is not None]
        if changed and np.any(changed, axis=0).sum() > MAX_CHANGED_SHARE * comparable.sum():
            return Detection((), "most of the view differs", camera, observed_rgb)
        arrays = _core.mask_arrays(masks, camera)
        fine_depths = None
        if depth == "fine":
            unknown["no depth is measured"] = observed_depth <= 0
            rendered_depth = np.where(comparable, images.depth, np.float32(0))
            fine_depths = observed_depth, rendered_depth, errors["depth_error"]
        if config.strategy == "gs_lts":  # It decides by the whole frame, not by regions.
            unknown = {}
        unknown = {reason: mask & pixels for reason, pixels in unknown.items()}
        return Detection(
            changes=changes,
            unreliable=None,
            camera=camera,
            observed_rgb=observed_rgb,
            rendered_rgb=rendered_rgb,
            pixel_mask=arrays["pixel"],
            feature_mask=arrays["feature"],
            combined_mask=arrays["combined"],
            exposure=exposure,
            surfaces=surfaces,
            labels=labels,
            unknown=unknown_regions(unknown, surfaces, labels),
            fine_depths=fine_depths,
        )

    def _expected_errors(self, images: Images) -> dict[str, Floats32]:
        """Return [H,W] expected errors of the rendered depth, m, and colours, as for `Views`."""
        return {"depth_error": _mean_drawn(images, 1), "color_error": _mean_drawn(images, 2)}

    def _unknown_pixels(
        self, images: Images, known: Bools, detail: Detail, depth: DepthQuality
    ) -> dict[str, Bools]:
        """Return [H,W] pixels of the images that are not compared, by the reason."""
        pixels = {"the map does not cover it": ~known}
        if self.config.strategy == "gs_lts":  # The printed rule compares all others.
            return pixels
        pixels["the image is blurred"] = detail.blurred_pixels()
        if depth == "fine":
            measured = images.features[..., 0] >= MIN_MEASURED_WEIGHT * images.alpha
            pixels["no frame of the map measured its depth"] = ~measured
        return pixels

    def _changes(
        self, views: _core.Views, masks: _core.Masks, depth: DepthQuality, came: Floats32
    ) -> tuple[tuple[Change, ...], tuple[_core.Surface, ...], Ints32]:
        """Return the changes, the surfaces they come from, and the label image of either.

        Args:
            views: Images of the frame and of the map.
            masks: Of the same views.
            depth: Quality of the measured depth.
            came: [H,W] weight, 0 to 1, of what updates added in each pixel of the map.
        """
        if self.config.strategy == "gs_lts":
            change, labels = _core.detect_gs_lts(views, masks, self.config.gs_lts)
            return () if change is None else (gs_lts_change(change, labels),), (), labels
        is_fine = depth == "fine"
        find = _core.find_changed_surfaces if is_fine else _core.find_changed_regions
        surfaces, labels = find(views, masks, self.config.objects)
        added = find_added(surfaces, labels, came)
        expect_departures(surfaces, added)
        if self._visibility.has_cameras:
            for surface in surfaces:
                surface.visibility = self._visibility_of(surface)
        rule = self.config.objects
        judged = [surface for surface in surfaces if surface_fault(surface) is None]
        shifts: list[Change] = []
        if is_fine:
            likely = [s for s in judged if _core.confidence(s) >= rule.min_confidence]
            found = _core.find_shifts(views, masks, likely, labels, rule)
            shifts = [shift_change(shift, likely, labels) for shift in found]
            shifted = {likely[row].label for shift in found for row in shift.surfaces}
            judged = [surface for surface in judged if surface.label not in shifted]
            find_recorded(judged, self._measurements.depths, self._left, self._came, added)
            judged = [surface for surface in judged if surface_fault(surface) is None]
        objects = object_changes(judged, labels, rule, is_measured=depth != "none")
        changes = (*shifts, *objects)
        by_confidence = sorted(changes, key=lambda change: -change.confidence)
        return tuple(by_confidence), tuple(surfaces), labels

    def _visibility_of(self, surface: _core.Surface) -> _core.Visibility:
        """Count how the training cameras saw the samples of a surface."""
        counts = self._visibility.counts(np.array(surface.samples))
        needed = self._min_witnesses
        if surface.side == _core.Side.BEFORE:
            needed = min(needed, MIN_MAP_WITNESSES)
        seen = counts.on + counts.through >= needed
        return _core.Visibility(
            on_surface=counts.on.sum(),
            seen_through=counts.through.sum(),
            known_share=float(seen.mean()),
        )


def _within(image: Floats32, mask: Bools | None) -> Floats32:
    """Return the pixels of an image within a mask; without one the image, as copies cost time."""
    return image if mask is None else image[mask]


def _mean_drawn(images: Images, channel: int) -> Floats32:
    """Return [H,W] the mean of a channel over the Gaussians that each pixel shows."""
    weight = np.maximum(images.alpha, MIN_ERROR_ALPHA)
    return np.ascontiguousarray(images.features[..., channel] / weight, np.float32)


def choose_evenly(cameras: Sequence[Camera], count: int) -> list[Camera]:
    """Return `count` evenly spaced cameras of a sequence, or all of them if they are fewer.

    Args:
        cameras: In the order in which they were taken.
        count: Maximum number of cameras.
    """
    count = min(len(cameras), count)
    return [cameras[k] for k in np.linspace(0, len(cameras) - 1, count).round().astype(int)]
