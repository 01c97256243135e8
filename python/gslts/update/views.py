"""What a frame shows of a change."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.change.constants import NEAR_SIGMAS
from gslts.change.detector import Detection
from gslts.core.camera import Camera, at_pose, unproject
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.localization.alignment import align_pose
from gslts.rendering.losses import Exposure
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Bools, Floats32
from gslts.update.region import Region

LEAST_ALPHA = 0.5
"""Where the map is less opaque, it shows no surface."""
ALIGN_STEPS = 3
"""Of the pose, at half and at full resolution."""
MOST_ALIGNED_M = 0.1
"""A pose that this moves farther from the one at which the change was detected is not trusted."""


@dataclass(frozen=True, eq=False)
class View:
    """A frame that was compared with the map.

    Attributes:
        frame: Registered, at the corrected pose.
        exposure: From the map's colours to those of the frame.
        rendered: [H,W] depth of the map, m; 0 where it shows nothing.
        shown: [H,W,3] its colours, sRGB, 0 to 1.
        before: [H,W] where the map shows what is gone.
        after: [H,W] where the frame shows what is new.
    """

    frame: RgbdFrame
    exposure: Exposure
    rendered: Floats32
    shown: Floats32
    before: Bools
    after: Bools

    @property
    def camera(self) -> Camera:
        """Of the colours, at the corrected pose."""
        return self.frame.camera

    @property
    def changed(self) -> Bools:
        """[H,W] where something is gone or new."""
        return self.before | self.after

    @property
    def depth(self) -> Floats32:
        """[H,W] m; 0 where there is no measurement."""
        depth: Floats32 = np.nan_to_num(self.frame.depth)
        return depth

    @property
    def colors(self) -> Floats32:
        """[H,W,3] sRGB, 0 to 1, as the map would have to show them."""
        gain, offset = (
            np.array(one, np.float32) for one in (self.exposure.gain, self.exposure.offset)
        )
        photo = self.frame.rgb.astype(np.float32) / np.float32(255)
        colors: Floats32 = (photo - offset) / gain
        return colors


def view_of(detection: Detection, frame: RgbdFrame, regions: Iterable[Region]) -> View | None:
    """What a frame shows of some regions, but for what the map does; None where it is unreliable.

    Args:
        detection: Of the frame.
        frame: What a robot saw.
        regions: Where something changed.
    """
    if detection.labels is None:
        return None
    whole = frame.registered()
    camera = at_pose(whole.camera, detection.camera.world_from_camera)
    before, after = masks_of(detection, whole.rgb.shape[:2], list(regions))
    moved = replace(whole, camera=camera)
    unknown, black = (np.zeros(one.shape, np.float32) for one in (whole.depth, whole.rgb))
    return View(moved, detection.exposure, unknown, black, before, after)


def masks_of(
    detection: Detection, shape: tuple[int, ...], regions: Sequence[Region]
) -> tuple[Bools, Bools]:
    """[H,W] where the map shows what is gone, and where a frame shows what is new.

    Args:
        detection: Of the frame, with labels.
        shape: Of the frame, (H, W).
        regions: Where something changed.
    """
    assert detection.labels is not None
    masks = []
    for side in ("before", "after"):
        own = [region for region in regions if region.side == side]
        labels = [
            one.label for one in detection.surfaces if any(region.is_of(one) for region in own)
        ]
        masks.append(_enlarged(np.isin(detection.labels, labels), shape))
    before, after = masks
    return before, after


def aligned_view(view: View, gaussian_map: GaussianMap, threads: int = 0) -> View | None:
    """The view at the pose where the map fits it best at full resolution, and what the map shows.

    None where that pose is far from the one given: then too little in the view tells it.

    Changes are looked for in smaller images, whose poses are off by more than new Gaussians may be.

    Args:
        view: Of the map before anything is edited.
        gaussian_map: float32.
        threads: 0 means one a hardware thread.
    """
    whole = view.frame
    same = ~view.changed if whole.mask is None else whole.mask & ~view.changed
    frame = RgbdFrame(whole.rgb, whole.depth, whole.camera, mask=same)
    pose = align_pose(gaussian_map, [frame.halved(), frame], ALIGN_STEPS, threads=threads)
    if not np.linalg.norm(pose[:3, 3] - whole.camera.world_from_camera[:3, 3]) < MOST_ALIGNED_M:
        return None
    camera = at_pose(whole.camera, pose)
    moved = replace(whole, camera=camera)
    # A wall beside the camera would become fog before what is behind: as if something was gone.
    options = RenderOptions(near_sigmas=NEAR_SIGMAS, threads=threads)
    images = Rasterizer(np.float32).forward(gaussian_map, camera, options)
    rendered = np.where(images.alpha >= LEAST_ALPHA, images.depth, 0).astype(np.float32)
    shown = np.asarray(images.rgb, np.float32)
    return replace(view, frame=moved, rendered=rendered, shown=shown)


def near_region(depth: Floats32, camera: Camera, region: Region, margin_m: float) -> Bools:
    """[H,W] where a surface is in the box of a region, or that near to it.

    Args:
        depth: [H,W] m; 0 where there is none.
        camera: Of it.
        region: Whose box it is.
        margin_m: How near.
    """
    near: Bools = np.zeros(depth.shape, np.bool_)
    rectangle = region.grown(margin_m).rectangle(camera, 0)
    if rectangle is None:
        return near
    x0, y0, x1, y1 = rectangle
    part = depth[y0:y1, x0:x1]
    rows, columns = np.indices(part.shape)
    places = np.column_stack([columns.ravel() + x0 + 0.5, rows.ravel() + y0 + 0.5])
    points = unproject(camera, places, part.ravel().astype(np.float64))
    near[y0:y1, x0:x1] = region.contains(points, margin_m).reshape(part.shape) & (part > 0)
    return near


def _enlarged(mask: Bools, shape: tuple[int, ...]) -> Bools:
    """A mask of an image whose sides were halved, at the size of the whole."""
    scale = shape[0] // mask.shape[0]
    large = mask.repeat(scale, axis=0).repeat(scale, axis=1)
    missing = [(0, whole - part) for whole, part in zip(shape, large.shape, strict=True)]
    return np.pad(large, missing)
