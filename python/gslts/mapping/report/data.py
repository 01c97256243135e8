"""What the report of a run of the mapping engine shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_VIEWS = 25
"""More make the page too large to send."""


@dataclass(frozen=True)
class CurvePoint:
    """Where the optimisation was at some time.

    Attributes:
        seconds: Since it started.
        iteration: Steps done.
        level: Of the images that come next; 0 is the full resolution.
        training_psnr_db: Of the frames learned from.
        held_out_psnr_db: Of frames kept aside; None if they were not looked at.
        gaussians: In the map.
    """

    seconds: float
    iteration: int
    level: int
    training_psnr_db: float
    held_out_psnr_db: float | None
    gaussians: int


@dataclass(frozen=True, eq=False)
class View:
    """A frame kept aside, and the map from there.

    Attributes:
        name: Of the frame.
        photo: [H,W,3] uint8.
        render: [H,W,3] uint8, with the exposure of the photograph.
        measured_depth: [H,W], m; 0 or NaN where there is no measurement.
        rendered_depth: [H,W], m.
        psnr_db: Of the rendering.
        mask: [H,W] bool, True where the colour camera saw something; None means everywhere.
    """

    name: str
    photo: NDArray[np.uint8]
    render: NDArray[np.uint8]
    measured_depth: NDArray[np.float32]
    rendered_depth: NDArray[np.float32]
    psnr_db: float
    mask: NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class ReportData:
    """What the page shows; what is empty is left out.

    Attributes:
        title: Such as the name of the data set.
        summary: One line.
        metrics: Numbers by name, by the way in which frames kept aside are judged ("given poses").
        gaussians_needed: For maps of several sizes the name ("half"), the number of Gaussians and
            the PSNR in dB.
        curve: In the order of time.
        views: Frames kept aside; of more than MOST_VIEWS, some are shown.
        findings: About the camera and the data set, by name.
        pose_shifts_m: How far each pose was corrected.
        pose_turns_rad: By what angle.
        skipped: Frames that were not used, and why.
        config: All settings.
    """

    title: str
    summary: str
    metrics: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    gaussians_needed: Sequence[tuple[str, int, float]] = ()
    curve: Sequence[CurvePoint] = ()
    views: Sequence[View] = ()
    findings: Mapping[str, str] = field(default_factory=dict)
    pose_shifts_m: Sequence[float] = ()
    pose_turns_rad: Sequence[float] = ()
    skipped: Sequence[str] = ()
    config: Mapping[str, Any] = field(default_factory=dict)
