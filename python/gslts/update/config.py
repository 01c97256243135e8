"""How a map is updated: settings of the Active Scene Updater."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from gslts.mapping.config import Count, Positive, Rate, Share


class CollectConfig(BaseModel):
    """From where a robot looks at a change.

    Attributes:
        steps: K of the paper: so many steps along the tangent, half of them to either side.
        step_m: Least length of a step; longer ones where the robot can go farther around.
        distance_m: From the middle of the region to the camera, on the floor, at first.
        held_back: Every so manieth view is kept to judge the update.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    steps: Annotated[int, Field(ge=2, le=100)] = 8
    step_m: Positive = 0.35
    distance_m: Positive = 1.2
    held_back: Annotated[int, Field(ge=2)] = 4


class EditConfig(BaseModel):
    """How Gaussians are removed and added before the refinement.

    Attributes:
        vote_share: rho of the paper: the share of views in whose masks a Gaussian must lie to be
            removed.
        visible_votes: Whether a Gaussian counts only in views where it is not hidden in the map;
            otherwise in all, as printed.
        carve: Whether what views see through is removed.
        sweep: Whether what is left in the midst of removed Gaussians is removed too.
        only_missing: Whether points are made only where the map, once Gaussians were removed, does
            not show what was measured.
        flat: Whether new Gaussians lie flat on the measured surface; otherwise they have the shape
            of the nearest one, and are as dense.
        observed_colors: Whether they have the colour of the photographs; otherwise that of the
            nearest one, or of the object that was moved.
        voxel_m: Edge of the voxels that seed a flat Gaussian each, m.
        contrast: Where colours change by less over larger voxels, these seed one.
        margin_m: How far beyond the boxes of a change it may reach, m.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    vote_share: Share = 0.5
    visible_votes: bool = True
    carve: bool = True
    sweep: bool = True
    only_missing: bool = True
    flat: bool = True
    observed_colors: bool = True
    voxel_m: Positive = 0.015
    contrast: Rate = 0.1
    margin_m: Rate = 0.1


GS_LTS = EditConfig(
    visible_votes=False,
    carve=False,
    sweep=False,
    only_missing=False,
    flat=False,
    observed_colors=False,
)
"""The pre-editing as printed in GS-LTS, sec. III-D."""


class RefineConfig(BaseModel):
    """How edited Gaussians, and those around them, are fitted to the views.

    Attributes:
        iterations: At most.
        scope: "region" renders and moves only what is near the change; "map" all, as plain
            fine-tuning does.
        reach_m: Gaussians so near to the boxes of the change may move.
        around_px: So many pixels around what changed are fitted.
        remembered: Old views that are kept as they were, at most.
        new_visits: New views are fitted so often for each time that old ones are.
        patience: The refinement ends when the error fell by less than `least_gain` in so many
            rounds of all views.
        least_gain: Share of the error.
        dssim_weight: Of 1 - SSIM against L1 of the colours.
        depth_weight: Of the relative error of the depth.
        means_rate, quats_rate, log_scales_rate, logit_opacities_rate, sh_rate: Of Adam, at the
            start.
        rates_left: Share of them that is left at the end.
        seed: Of the order of the views.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    iterations: Count = 250
    scope: Literal["region", "map"] = "region"
    reach_m: Rate = 0.45
    around_px: Count = 80
    remembered: Count = 20
    new_visits: Annotated[int, Field(ge=1, le=100)] = 2
    patience: Annotated[int, Field(ge=1)] = 2
    least_gain: Rate = 0.01
    dssim_weight: Share = 0.2
    depth_weight: Rate = 0.2
    means_rate: Rate = 1e-3
    quats_rate: Rate = 2e-2
    log_scales_rate: Rate = 3e-2
    logit_opacities_rate: Rate = 6e-2
    sh_rate: Rate = 2e-2
    rates_left: Share = 0.05
    seed: Count = 0


class UpdateConfig(BaseModel):
    """Settings of the stages of an update.

    Attributes:
        threads: 0 means one a hardware thread.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    collect: CollectConfig = CollectConfig()
    edit: EditConfig = EditConfig()
    refine: RefineConfig = RefineConfig()
    threads: Count = 0
