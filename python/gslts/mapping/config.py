"""How a map is made: settings of the mapping engine."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0)]
Rate = Annotated[float, Field(ge=0)]


class MappingConfig(BaseModel):
    """Settings of one run; defaults are those of the preset `balanced`.

    Attributes:
        iterations: Steps of the optimisation, each with one frame.
        voxel_m: Edge of the voxels of which each that was measured twice seeds a Gaussian, m.
        sh_degree: Of the spherical harmonics.
        coarse_share: Share of the iterations at half the resolution.
        refine_poses: Whether poses are corrected along the way.
        refine_lenses: Whether focal lengths and the place of the depth lens are, too.
        pose_std_m: How far given positions are expected to be off, m.
        pose_std_rad: How far given rotations are expected to be off, rad.
        dssim_weight: Of 1 - SSIM against L1 of the colours.
        depth_weight: Of the relative error of the depth.
        opacity_weight: Of 1 - alpha, which closes holes.
        min_opacity: Fainter Gaussians are removed.
        max_scale_m: Standard deviations are kept below.
        means_rate, quats_rate, log_scales_rate, logit_opacities_rate, sh_rate: Of Adam, at the
            start.
        means_left: Share of the first rate that is left at the end.
        rates_left: The same for all others.
        seed: Of the order of the frames.
        threads: 0 means one a hardware thread.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    iterations: Annotated[int, Field(gt=0)] = 4500
    voxel_m: Positive = 0.03
    sh_degree: Annotated[int, Field(ge=0, le=3)] = 0
    coarse_share: Share = 0.4
    refine_poses: bool = True
    refine_lenses: bool = True
    pose_std_m: Positive = 0.01
    pose_std_rad: Positive = 0.01
    dssim_weight: Share = 0.2
    depth_weight: Rate = 0.5
    opacity_weight: Rate = 0.01
    min_opacity: Share = 0.02
    max_scale_m: Positive = 0.3
    means_rate: Rate = 1e-3
    quats_rate: Rate = 8e-3
    log_scales_rate: Rate = 1.6e-2
    logit_opacities_rate: Rate = 8e-2
    sh_rate: Rate = 1.2e-2
    means_left: Share = 0.05
    rates_left: Share = 0.15
    seed: Annotated[int, Field(ge=0)] = 0
    threads: Annotated[int, Field(ge=0)] = 0


PRESETS = {
    "fast": MappingConfig(iterations=1200, voxel_m=0.035, coarse_share=0.7),
    "balanced": MappingConfig(),
    "best": MappingConfig(iterations=14_000, coarse_share=0.25),
}
"""Speed against accuracy, in three steps."""
