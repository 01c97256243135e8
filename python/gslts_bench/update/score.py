"""How well a map shows a change, from where it is judged.

Source: GS-LTS, sec. IV-A: 20 test views of each task, cropped to the boxes of the change and 50
pixels around them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.localization.alignment import aligned
from gslts.rendering.losses import Exposure, apply_exposure, fit_exposure
from gslts.rendering.metrics import MIN_SIDE_PX, Lpips, psnr_db, ssim
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Bools, Floats32
from gslts.update.region import Region
from gslts_sim.task import Change

AROUND_PX = 50
ALIGN_STEPS = 4
Rectangle = tuple[int, int, int, int]


@dataclass(frozen=True)
class Score:
    """Means over test views.

    Attributes:
        psnr_db: Of the crops.
        ssim: Of the crops.
        flip: Of the crops: LDR-FLIP (Andersson et al. 2020), 0 for equal pictures.
        lpips: Of the crops; None without weights.
        outside_db: PSNR of all else.
        true_pose_db: PSNR of the crops where cameras are taken to be where they are in the world,
            and not where the map says.
    """

    psnr_db: float
    ssim: float
    flip: float
    lpips: float | None
    outside_db: float
    true_pose_db: float


@dataclass(frozen=True, eq=False)
class JudgedView:
    """A clean picture of the changed home.

    Attributes:
        near: Whether it is one of the near ones.
        photo: [H,W,3] sRGB, 0 to 1.
        camera: Where the map before the change says that it was taken, by what did not change: a
            map is a few millimetres off, as the poses were that it was made from.
        true_camera: Where it was taken in the world.
        crops: Columns [x0, x1) and rows [y0, y1) around each box of the change.
        inside: [H,W] bool, in a crop.
        exposure: From the map's colours, fitted where nothing changed; the same for all methods.
    """

    near: bool
    photo: Floats32
    camera: Camera
    true_camera: Camera
    crops: tuple[Rectangle, ...]
    inside: Bools
    exposure: Exposure


def judged_view(
    frame: RgbdFrame, change: Change, before: GaussianMap, *, near: bool
) -> JudgedView | None:
    """A clean frame of the changed home, as the map before the change sees it.

    Returns:
        None if no box of the change is in it.
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
    camera, exposure, _ = as_mapped(rest, before)
    photo = frame.rgb.astype(np.float32) / np.float32(255)
    return JudgedView(near, photo, camera, frame.camera, tuple(crops), inside, exposure)


def as_mapped(frame: RgbdFrame, gaussian_map: GaussianMap) -> tuple[Camera, Exposure, Floats32]:
    """Where a map says that a frame was taken, how it is exposed, and what the map shows there.

    Args:
        frame: Its mask tells what is compared; the pose is nearly right.
        gaussian_map: float32.

    Returns:
        The camera, the exposure from the map's colours to those of the frame, and [H,W,3] the map's
        colours.
    """
    pose = aligned(gaussian_map, [frame.halved(), frame], ALIGN_STEPS, threads=1)
    camera = at_pose(frame.camera, pose)
    photo = frame.rgb.astype(np.float32) / np.float32(255)
    rgb = Rasterizer(np.float32).forward(gaussian_map, camera, RenderOptions(threads=1)).rgb
    return camera, fit_exposure(rgb, photo, mask=frame.mask, threads=1), np.asarray(rgb, np.float32)


class Judge:
    """Scores maps by some test views.

    Args:
        views: At least one near and one far.
        lpips: None leaves LPIPS out.
    """

    def __init__(self, views: Sequence[JudgedView], lpips: Lpips | None = None) -> None:
        self.views, self._lpips = views, lpips
        self._rasterizer, self._options = Rasterizer(np.float32), RenderOptions(threads=1)

    def scores(self, gaussian_map: GaussianMap) -> dict[str, Score]:
        """Of the near and of the far views."""
        return {
            name: _mean([self._score(gaussian_map, one) for one in self.views if one.near == near])
            for name, near in (("near", True), ("far", False))
        }

    def psnrs_db(self, gaussian_map: GaussianMap) -> dict[str, float]:
        """The PSNR of the crops alone."""
        return {
            name: float(
                np.mean(
                    [
                        psnr_db(self.shown(gaussian_map, one, one.camera), one.photo, one.inside)
                        for one in self.views
                        if one.near == near
                    ]
                )
            )
            for name, near in (("near", True), ("far", False))
        }

    def shown(self, gaussian_map: GaussianMap, view: JudgedView, camera: Camera) -> Floats32:
        """[H,W,3] what a map shows from a camera, as the picture of a view is exposed."""
        rgb = self._rasterizer.forward(gaussian_map, camera, self._options).rgb
        return np.asarray(apply_exposure(rgb, view.exposure).clip(0, 1), np.float32)

    def _score(self, gaussian_map: GaussianMap, view: JudgedView) -> Score:
        rgb = self.shown(gaussian_map, view, view.camera)
        at_truth = self.shown(gaussian_map, view, view.true_camera)
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
        """LPIPS of a crop, which is made as large as that needs."""
        assert self._lpips is not None  # Or it is not asked for.
        x0, y0, x1, y1 = crop
        height, width = photo.shape[:2]
        x0, y0 = min(x0, width - MIN_SIDE_PX), min(y0, height - MIN_SIDE_PX)
        x1, y1 = max(x1, x0 + MIN_SIDE_PX), max(y1, y0 + MIN_SIDE_PX)
        return self._lpips.distance(rgb[y0:y1, x0:x1], photo[y0:y1, x0:x1])


def _flip(rgb: Floats32, photo: Floats32, crop: Rectangle) -> float:
    import flip_evaluator

    x0, y0, x1, y1 = crop
    pair = (np.ascontiguousarray(one[y0:y1, x0:x1]) for one in (photo, rgb))
    _, mean, _ = flip_evaluator.evaluate(*pair, "LDR", applyMagma=False)
    return float(mean)


def _mean_over(crops: Sequence[Rectangle], score: Callable[[Rectangle], float]) -> float:
    """The mean of a score over crops, by their sizes."""
    sizes = [(x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in crops]
    return float(np.average([score(crop) for crop in crops], weights=sizes))


def _mean(scores: Sequence[Score]) -> Score:
    values = {}
    for one in fields(Score):
        numbers = [getattr(score, one.name) for score in scores]
        values[one.name] = None if None in numbers else float(np.mean(numbers))
    return Score(**values)  # type: ignore[arg-type]  # Only LPIPS may be None.
