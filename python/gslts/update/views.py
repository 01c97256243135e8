"""A frame of a change, aligned with the map: masks of what was removed and added."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gslts.change.constants import NEAR_SIGMAS
from gslts.change.depth_quality import depth_quantum_m
from gslts.change.detection import Detection
from gslts.core.camera import Camera, at_pose, unproject
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.localization.alignment import align_pose
from gslts.rendering.losses import Exposure
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.rendering.view_range import MIN_RANGE_M, view_range_m
from gslts.types import Bools, Floats32
from gslts.update.region import Region

MIN_ALPHA = 0.5
"""Minimum opacity of a rendered pixel that shows a surface."""
FRONT_M = 0.005
"""Minimum distance of an added object from the surface that it occludes, where depth is coarse, m;
more than the thickness of flat Gaussians."""
MAX_ALIGNMENT_M = 0.1
"""Maximum distance between the pose of the detection and the aligned pose, m. A larger one means
that the view has too little texture to align it."""


@dataclass(frozen=True, eq=False)
class View:
    """A frame that was compared with the map.

    Attributes:
        frame: Registered RGB-D frame at the aligned pose.
        exposure: Maps rendered colours to the colours of the frame.
        rendered_depth: [H,W] float32 depth of the map, m; 0 where it shows no surface.
        rendered_rgb: [H,W,3] float32 colours of the map, sRGB, 0 to 1.
        before: [H,W] bool, pixels where the map shows a removed object.
        after: [H,W] bool, pixels where the frame shows an added object.
        depth_quantum_m: Step between the depths that the sensor tells apart, m; 0 if unknown.
    """

    frame: RgbdFrame
    exposure: Exposure
    rendered_depth: Floats32
    rendered_rgb: Floats32
    before: Bools
    after: Bools
    depth_quantum_m: float = 0.0

    @property
    def camera(self) -> Camera:
        """Camera of the colours at the aligned pose."""
        return self.frame.camera

    @property
    def changed(self) -> Bools:
        """[H,W] pixels of removed or added objects: M_comb of GS-LTS."""
        return self.before | self.after

    @cached_property
    def depth(self) -> Floats32:
        """[H,W] measured depth, m; 0 where there is no measurement."""
        depth: Floats32 = np.nan_to_num(self.frame.depth)
        return depth

    @cached_property
    def colors(self) -> Floats32:
        """[H,W,3] sRGB, 0 to 1, at the exposure of the map."""
        gain, offset = (
            np.array(value, np.float32) for value in (self.exposure.gain, self.exposure.offset)
        )
        observed = self.frame.rgb.astype(np.float32) / np.float32(255)
        colors: Floats32 = (observed - offset) / gain
        return colors

    def shows_added(self, box: tuple[int, int, int, int]) -> bool:
        """Return whether an added object is visible in a box of the image.

        Args:
            box: Columns [x0, x1) and rows [y0, y1), as (x0, y0, x1, y1).
        """
        x0, y0, x1, y1 = box
        return bool(self.after[y0:y1, x0:x1].any())


def view_from_detection(
    detection: Detection, frame: RgbdFrame, regions: Iterable[Region]
) -> View | None:
    """Return the view of a frame, still without a rendering of the map.

    Args:
        detection: Of the frame.
        frame: RGB-D frame.
        regions: Regions of the changes.

    Returns:
        The view at the pose of the detection; None if the detection is unreliable.
    """
    if detection.labels is None:
        return None
    whole = frame.registered()
    camera = at_pose(whole.camera, detection.camera.world_from_camera)
    before, after = region_masks(detection, whole.rgb.shape[:2], list(regions))
    no_depth, no_rgb = (np.zeros(image.shape, np.float32) for image in (whole.depth, whole.rgb))
    whole = replace(whole, camera=camera)
    quantum_m = depth_quantum_m(whole.depth)
    return View(whole, detection.exposure, no_depth, no_rgb, before, after, quantum_m)


def region_masks(
    detection: Detection, shape: tuple[int, ...], regions: Sequence[Region]
) -> tuple[Bools, Bools]:
    """Return the masks of removed and added objects in a frame.

    Args:
        detection: Of the frame, with labels.
        shape: (H, W) of the frame.
        regions: Regions of the changes.

    Returns:
        [H,W] bool for "before", and [H,W] bool for "after".
    """
    assert detection.labels is not None
    masks = []
    for side in ("before", "after"):
        own = [region for region in regions if region.side == side]
        labels = [
            surface.label
            for surface in detection.surfaces
            if any(region.matches(surface) for region in own)
        ]
        masks.append(_upscale(np.isin(detection.labels, labels), shape))
    before, after = masks
    return before, after


def align_view(view: View, gaussian_map: GaussianMap, threads: int = 0) -> View | None:
    """Align a view with the map at full resolution, and render the map there.

    Changes are detected in small images, whose poses are less accurate than new Gaussians must be.

    Args:
        view: From `view_from_detection`.
        gaussian_map: float32, before any edit.
        threads: 0 uses all hardware threads.

    Returns:
        The view at the aligned pose, with rendered images; None if that pose is far from the pose
        of the detection.
    """
    whole = view.frame
    unchanged = ~view.changed if whole.mask is None else whole.mask & ~view.changed
    frame = RgbdFrame(whole.rgb, whole.depth, whole.camera, mask=unchanged)
    pose = align_pose(gaussian_map, [frame.halved(), frame], threads=threads)
    if not np.linalg.norm(pose[:3, 3] - whole.camera.world_from_camera[:3, 3]) < MAX_ALIGNMENT_M:
        return None
    view = replace(view, frame=replace(whole, camera=at_pose(whole.camera, pose)))
    return render_view(view, gaussian_map, threads)


def render_view(view: View, gaussian_map: GaussianMap, threads: int = 0) -> View:
    """Return a view with the rendered images of a map.

    Args:
        view: At the aligned pose.
        gaussian_map: float32, before any edit.
        threads: 0 uses all hardware threads.
    """
    # Without the near limit, a wall beside the camera is rendered as fog before the scene.
    options = RenderOptions(
        far_m=view_range_m(view.depth), near_sigmas=NEAR_SIGMAS, threads=threads
    )
    images = Rasterizer(np.float32).forward(gaussian_map, view.camera, options)
    depth = np.where(images.alpha >= MIN_ALPHA, images.depth, 0).astype(np.float32)
    rgb = np.asarray(images.rgb, np.float32)
    return replace(view, rendered_depth=depth, rendered_rgb=rgb)


def largest_range_m(views: Iterable[View]) -> float:
    """Return the distance beyond which no view is compared with the map, m.

    Args:
        views: Any number.
    """
    return max([MIN_RANGE_M, *(view_range_m(view.depth) for view in views)])


def bring_to_front(view: View) -> View:
    """Return a view in which each added object is nearer than the surface that it occludes.

    By coarse depth, half of an object may lie behind that surface, which would hide its Gaussians.

    Args:
        view: With masks of what was added.
    """
    depth = view.depth.copy()
    farthest = view.rendered_depth - FRONT_M
    behind = view.after & (view.rendered_depth > 0) & (depth > farthest)
    depth[behind] = farthest[behind]
    return replace(view, frame=replace(view.frame, depth=depth))


def pixels_in_region(depth: Floats32, camera: Camera, region: Region, margin_m: float) -> Bools:
    """Return the pixels whose surface lies in a region.

    Args:
        depth: [H,W] m; 0 where there is no surface.
        camera: Of the depth image.
        region: The box.
        margin_m: Enlarges the box on all sides, m.

    Returns:
        [H,W] bool.
    """
    mask: Bools = np.zeros(depth.shape, np.bool_)
    rectangle = region.expand(margin_m).project_box(camera, 0)
    if rectangle is None:
        return mask
    x0, y0, x1, y1 = rectangle
    part = depth[y0:y1, x0:x1]
    rows, columns = np.indices(part.shape)
    pixels = np.column_stack([columns.ravel() + x0 + 0.5, rows.ravel() + y0 + 0.5])
    points = unproject(camera, pixels, part.ravel().astype(np.float64))
    mask[y0:y1, x0:x1] = region.contains(points, margin_m).reshape(part.shape) & (part > 0)
    return mask


def _upscale(mask: Bools, shape: tuple[int, ...]) -> Bools:
    """Enlarge a mask of a halved image to the size of the full image."""
    scale = shape[0] // mask.shape[0]
    large = mask.repeat(scale, axis=0).repeat(scale, axis=1)
    missing = [(0, full - part) for full, part in zip(shape, large.shape, strict=True)]
    return np.pad(large, missing)
