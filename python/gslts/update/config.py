"""Settings of the Active Scene Updater, one model per stage."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from gslts.mapping.config import Count, Positive, Rate, Share


class CollectConfig(BaseModel):
    """Settings of the data collection around a region.

    Attributes:
        steps: Number of steps along the tangent, K of GS-LTS: half of them to the left, then K to
            the right.
        step_m: Minimum length of a step, m; the steps are longer where the robot can move farther
            around the region.
        distance_m: Initial distance of the camera from the centre of the region on the floor, m.
        validation_every: One of this many views is held out to accept or reject the update.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    steps: Annotated[int, Field(ge=2, le=100)] = 8
    step_m: Positive = 0.35
    distance_m: Positive = 1.2
    validation_every: Annotated[int, Field(ge=2)] = 4


class EditConfig(BaseModel):
    """Settings of the pre-editing.

    Attributes:
        vote_share: Share of the views in whose masks a Gaussian must lie to be removed, rho of
            GS-LTS.
        visible_votes: Count only views in which the map does not occlude the Gaussian; GS-LTS
            counts all views.
        carve: Also remove Gaussians that the views see through.
        sweep: Also remove Gaussians whose neighbours were removed.
        only_missing: Add Gaussians only where the map does not show the measured surface.
        flat: Add flat Gaussians on the measured surface; GS-LTS copies shape and density of the
            nearest Gaussian.
        observed_colors: Use the observed colours; GS-LTS copies those of the nearest Gaussian, or
            of the relocated object.
        rigid: Move the Gaussians of shifted objects; else these are removed and added anew.
        voxel_m: Edge of the voxels that seed one flat Gaussian each, m.
        contrast: Maximum change of colour, 0 to 1, over a larger voxel that seeds one Gaussian.
        margin_m: Distance from the regions up to which the edit may reach, m.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    vote_share: Share = 0.5
    visible_votes: bool = True
    carve: bool = True
    sweep: bool = True
    only_missing: bool = True
    flat: bool = True
    observed_colors: bool = True
    rigid: bool = True
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
    rigid=False,
)
"""Pre-editing of GS-LTS, sec. III-D, without our corrections."""


class RefineConfig(BaseModel):
    """Settings of the refinement.

    Attributes:
        iterations: Maximum number of steps.
        scope: "region" renders and fits only what is near the change; "map" fits all Gaussians, as
            plain fine-tuning does.
        reach_m: Maximum distance from a region to a Gaussian that may change, m.
        margin_px: Margin around the regions in which pixels are compared, px.
        replay_views: Maximum number of training cameras of the map whose rendering before the edit
            is fitted too.
        new_visits: Steps on each new view per step on an old one.
        patience: Number of rounds of all views in which the loss must fall, or the refinement ends.
        min_gain: Minimum share by which the loss must fall in these rounds.
        dssim_weight: Weight of 1 - SSIM against L1 of the colours.
        depth_weight: Weight of the relative error of the depth.
        means_rate, quats_rate, log_scales_rate, logit_opacities_rate, sh_rate: Initial learning
            rates of Adam.
        final_rate_share: Final learning rates as a share of the initial ones.
        seed: Seed of the order of the views and of the background.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    iterations: Count = 250
    scope: Literal["region", "map"] = "region"
    reach_m: Rate = 0.45
    margin_px: Count = 80
    replay_views: Count = 20
    new_visits: Annotated[int, Field(ge=1, le=100)] = 2
    patience: Annotated[int, Field(ge=1)] = 2
    min_gain: Rate = 0.01
    dssim_weight: Share = 0.2
    depth_weight: Rate = 0.2
    means_rate: Rate = 1e-3
    quats_rate: Rate = 2e-2
    log_scales_rate: Rate = 3e-2
    logit_opacities_rate: Rate = 6e-2
    sh_rate: Rate = 2e-2
    final_rate_share: Share = 0.05
    seed: Count = 0


class UpdateConfig(BaseModel):
    """Settings of an update.

    Attributes:
        collect: Of the data collection.
        edit: Of the pre-editing.
        refine: Of the refinement.
        threads: 0 uses all hardware threads.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    collect: CollectConfig = CollectConfig()
    edit: EditConfig = EditConfig()
    refine: RefineConfig = RefineConfig()
    threads: Count = 0
