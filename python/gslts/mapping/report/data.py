"""Content of the report of a mapping run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gslts.types import Bools, Bytes, Floats32

MAX_VIEWS = 25
"""Maximum number of views on the page: more make it too large to send by mail."""


@dataclass(frozen=True)
class CurvePoint:
    """State of the optimization after an epoch.

    Attributes:
        seconds: Time since the start of the run, s.
        iteration: Number of steps.
        level: Resolution of the next epoch; 0 is the full one.
        training_psnr_db: Mean PSNR of the training frames in the epoch, dB.
        validation_psnr_db: PSNR of the validation frames, dB; None without a validation.
        gaussians: Number of Gaussians.
    """

    seconds: float
    iteration: int
    level: int
    training_psnr_db: float
    validation_psnr_db: float | None
    gaussians: int


@dataclass(frozen=True, eq=False)
class View:
    """A test frame beside the rendering of the map.

    Attributes:
        name: Name of the frame.
        photo: [H,W,3] photograph.
        render: [H,W,3] rendering with the exposure of the photograph.
        measured_depth: [H,W] m; 0 or NaN is no measurement.
        rendered_depth: [H,W] m.
        psnr_db: PSNR of the rendering, dB.
        mask: [H,W] True where the colour camera saw something; None means everywhere.
    """

    name: str
    photo: Bytes
    render: Bytes
    measured_depth: Floats32
    rendered_depth: Floats32
    psnr_db: float
    mask: Bools | None = None


@dataclass(frozen=True, eq=False)
class ReportData:
    """Content of the page; empty parts are left out.

    Attributes:
        title: Heading, such as the name of the data set.
        summary: One line.
        metrics: Figures on test frames by name, for each choice of poses ("poses as given").
        variants: Name ("half"), number of Gaussians and validation PSNR (dB) of each variant.
        curve: Course of the optimization.
        views: Test frames; of more than MAX_VIEWS, some are shown.
        frames: Names of frames by purpose ("test", "validation").
        findings: Findings about the camera and the data set, by name.
        pose_shifts_m: Correction of each training pose, m.
        pose_turns_rad: Angle of each correction, rad.
        skipped: Frames that were not used, and why.
        config: All settings.
    """

    title: str
    summary: str
    metrics: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    variants: Sequence[tuple[str, int, float]] = ()
    curve: Sequence[CurvePoint] = ()
    views: Sequence[View] = ()
    frames: Mapping[str, Sequence[str]] = field(default_factory=dict)
    findings: Mapping[str, str] = field(default_factory=dict)
    pose_shifts_m: Sequence[float] = ()
    pose_turns_rad: Sequence[float] = ()
    skipped: Sequence[str] = ()
    config: Mapping[str, Any] = field(default_factory=dict)
