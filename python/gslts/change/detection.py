"""Result of the comparison of a frame with a map."""

from __future__ import annotations

from dataclasses import dataclass, field

from gslts._core import detect as _core
from gslts.change.changes import Change
from gslts.change.unknown import UnknownRegion
from gslts.core.camera import Camera
from gslts.rendering.losses import Exposure
from gslts.types import Bools, Floats32, Ints32


@dataclass(frozen=True, eq=False)
class Detection:
    """Result of the comparison of one frame with a map.

    Attributes:
        changes: Detected changes, by falling confidence; none if the frame is unreliable.
        unreliable: Reason why the frame cannot be compared; None if it can.
        camera: Camera of the images below, at the aligned pose.
        observed_rgb: [H,W,3] sRGB of the frame, 0 to 1.
        rendered_rgb: [H,W,3] sRGB of the map with the exposure of the frame; None if unreliable.
        pixel_mask: [H,W] M_pixel, where colours differ; None if unreliable.
        feature_mask: [H,W] M_feat, where features differ; None if unreliable.
        combined_mask: [H,W] M_comb, where both differ; None if unreliable.
        exposure: Exposure from the rendered to the observed colours.
        surfaces: All surfaces that only one of map and frame shows, likely changes or not; none
            with the strategy "gs_lts".
        labels: [H,W] label of the surface or mask component at each pixel, 0 for none; None if
            unreliable.
        unknown: Regions in which changes cannot be judged; none if the frame is unreliable, or with
            the strategy "gs_lts".
        fine_depths: [H,W] depth of the frame and of the map, m, 0 where there is none or changes
            cannot be judged, and expected error of the latter, m; None if the frame is unreliable
            or its depth not fine.
    """

    changes: tuple[Change, ...]
    unreliable: str | None
    camera: Camera
    observed_rgb: Floats32
    rendered_rgb: Floats32 | None = None
    pixel_mask: Bools | None = None
    feature_mask: Bools | None = None
    combined_mask: Bools | None = None
    exposure: Exposure = field(default_factory=Exposure)
    surfaces: tuple[_core.Surface, ...] = ()
    labels: Ints32 | None = None
    unknown: tuple[UnknownRegion, ...] = ()
    fine_depths: tuple[Floats32, Floats32, Floats32] | None = None
