"""Scores of a map at the test viewpoints of a change.

Source: GS-LTS, sec. IV-A: 20 test viewpoints per task, cropped to the boxes of the change and 50
pixels around them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.localization.alignment import align_pose
from gslts.rendering.losses import Exposure, apply_exposure, fit_exposure
from gslts.rendering.metrics import MIN_SIDE_PX, Lpips, psnr_db, ssim
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Bools, Floats32
from gslts.update.region import Region
from gslts_sim.task import Change

AROUND_PX = 50
"""Margin of crops around the boxes of a change, as in GS-LTS."""
Rectangle = tuple[int, int, int, int]
"""Columns [x0, x1) and rows [y0, y1): x0, y0, x1, y1, px."""


@dataclass(frozen=True)
class Score:
    """Means over test viewpoints.

    Attributes:
        psnr_db: PSNR of the crops.
        ssim: SSIM of the crops.
        flip: LDR-FLIP of the crops (Andersson et al. 2020), 0 for equal images.
        lpips: LPIPS of the crops; None without weights.
        outside_db: PSNR outside the crops.
        true_pose_db: PSNR of the crops from the true cameras, not aligned with the map.
    """

    psnr_db: float
    ssim: float
    flip: float
    lpips: float | None
    outside_db: float
    true_pose_db: float


@dataclass(frozen=True, eq=False)
class EvaluationView:
    """A test viewpoint with an image of the changed home, without noise.

    Attributes:
        near: Whether it is one of the near ones.
        photo: [H,W,3] sRGB, 0 to 1.
        camera: Camera aligned with the map before the change, where nothing changed: a map is a few
            millimetres off, as the poses were that it was made from.
        true_camera: Camera in the world.
        crops: Crop around each box of the change.
        inside: [H,W] bool, whether a pixel is in a crop.
        exposure: Exposure from the map's colours, fitted where nothing changed; the same for all
            methods.
    """

    near: bool
    photo: Floats32
    camera: Camera
    true_camera: Camera
    crops: tuple[Rectangle, ...]
    inside: Bools
    exposure: Exposure


def evaluation_view(
    frame: RgbdFrame, change: Change, before: GaussianMap, *, near: bool
) -> EvaluationView | None:
    """Align a noise-free frame of the changed home with the map before the change.

    Args:
        frame: Frame with its true camera.
        change: The change.
        before: Map before the change.
        near: Whether it is one of the near viewpoints.

    Returns:
        The test viewpoint; None if no box of the change is in view.
    """
    crops = []
    for box in (change.box_before, change.box_after):
        if box is not None:
            region = Region("after", np.array(box[0]), np.array(box[1]))
            rectangle = region.project_box(frame.camera, AROUND_PX)
            crops += [] if rectangle is None else [rectangle]
    if not crops:
        return None
    inside = np.zeros(frame.depth.shape, np.bool_)
    for x0, y0, x1, y1 in crops:
        inside[y0:y1, x0:x1] = True
    rest = RgbdFrame(frame.rgb, frame.depth, frame.camera, mask=~inside)
    camera, exposure, _ = align_with_map(rest, before)
    photo = frame.rgb.astype(np.float32) / np.float32(255)
    return EvaluationView(near, photo, camera, frame.camera, tuple(crops), inside, exposure)


def align_with_map(
    frame: RgbdFrame, gaussian_map: GaussianMap
) -> tuple[Camera, Exposure, Floats32]:
    """Align a frame with a map and fit its exposure.

    Args:
        frame: Frame with a nearly right pose; only pixels in its mask are compared.
        gaussian_map: float32.

    Returns:
        The aligned camera, the exposure from the map's colours to those of the frame, and the map's
        colours [H,W,3].
    """
    pose = align_pose(gaussian_map, [frame.halved(), frame], threads=1)
    camera = at_pose(frame.camera, pose)
    photo = frame.rgb.astype(np.float32) / np.float32(255)
    rgb = Rasterizer(np.float32).forward(gaussian_map, camera, RenderOptions(threads=1)).rgb
    return camera, fit_exposure(rgb, photo, mask=frame.mask, threads=1), np.asarray(rgb, np.float32)


class Judge:
    """Scores maps at test viewpoints.

    Args:
        views: At least one near and one far viewpoint.
        lpips: None leaves LPIPS out.
    """

    def __init__(self, views: Sequence[EvaluationView], lpips: Lpips | None = None) -> None:
        self.views, self._lpips = views, lpips
        self._rasterizer, self._options = Rasterizer(np.float32), RenderOptions(threads=1)

    def scores(self, gaussian_map: GaussianMap) -> dict[str, Score]:
        """Score a map at the near and at the far viewpoints.

        Args:
            gaussian_map: The map, float32.
        """
        return {
            name: _mean(
                [self._score(gaussian_map, view) for view in self.views if view.near == near]
            )
            for name, near in (("near", True), ("far", False))
        }

    def psnrs_db(self, gaussian_map: GaussianMap) -> dict[str, float]:
        """Return the PSNR of the crops at the near and at the far viewpoints, dB.

        Args:
            gaussian_map: The map, float32.
        """
        return {
            name: float(
                np.mean(
                    [
                        psnr_db(
                            self.render(gaussian_map, view, view.camera), view.photo, view.inside
                        )
                        for view in self.views
                        if view.near == near
                    ]
                )
            )
            for name, near in (("near", True), ("far", False))
        }

    def render(self, gaussian_map: GaussianMap, view: EvaluationView, camera: Camera) -> Floats32:
        """Render a map from a camera with the exposure of a test image; [H,W,3] sRGB, 0 to 1.

        Args:
            gaussian_map: The map, float32.
            view: Test viewpoint.
            camera: Camera to render from.
        """
        rgb = self._rasterizer.forward(gaussian_map, camera, self._options).rgb
        return np.asarray(apply_exposure(rgb, view.exposure).clip(0, 1), np.float32)

    def _score(self, gaussian_map: GaussianMap, view: EvaluationView) -> Score:
        rgb = self.render(gaussian_map, view, view.camera)
        at_truth = self.render(gaussian_map, view, view.true_camera)
        inside = view.inside
        return Score(
            psnr_db=psnr_db(rgb, view.photo, inside),
            ssim=ssim(rgb, view.photo, inside, threads=1),
            flip=_mean_over(view.crops, lambda crop: _flip(rgb, view.photo, crop)),
            lpips=None
            if self._lpips is None
            else _mean_over(view.crops, lambda crop: self._distance(rgb, view.photo, crop)),
            outside_db=psnr_db(rgb, view.photo, ~inside),
            true_pose_db=psnr_db(at_truth, view.photo, inside),
        )

    def _distance(self, rgb: Floats32, photo: Floats32, crop: Rectangle) -> float:
        """Return LPIPS of a crop, enlarged to the minimum size of the network."""
        assert self._lpips is not None  # Or it is not asked for.
        x0, y0, x1, y1 = crop
        height, width = photo.shape[:2]
        x0, y0 = min(x0, width - MIN_SIDE_PX), min(y0, height - MIN_SIDE_PX)
        x1, y1 = max(x1, x0 + MIN_SIDE_PX), max(y1, y0 + MIN_SIDE_PX)
        return self._lpips.distance(rgb[y0:y1, x0:x1], photo[y0:y1, x0:x1])


def _flip(rgb: Floats32, photo: Floats32, crop: Rectangle) -> float:
    import flip_evaluator

    x0, y0, x1, y1 = crop
    pair = (np.ascontiguousarray(image[y0:y1, x0:x1]) for image in (photo, rgb))
    _, mean, _ = flip_evaluator.evaluate(*pair, "LDR", applyMagma=False)
    return float(mean)


def _mean_over(crops: Sequence[Rectangle], score: Callable[[Rectangle], float]) -> float:
    """Average a score over crops, weighted by their areas."""
    sizes = [(x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in crops]
    return float(np.average([score(crop) for crop in crops], weights=sizes))


def _mean(scores: Sequence[Score]) -> Score:
    values = {}
    for metric in fields(Score):
        numbers = [getattr(score, metric.name) for score in scores]
        values[metric.name] = None if None in numbers else float(np.mean(numbers))
    return Score(**values)  # type: ignore[arg-type]  # Only LPIPS may be None.
