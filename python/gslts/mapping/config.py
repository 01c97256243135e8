"""How a map is made: settings of the mapping engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

Share = Annotated[float, Field(ge=0, le=1)]
LeastOpacity = Annotated[float, Field(ge=0, lt=1)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Rate = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0)]

USUAL_EXTENT_M = 2.0
"""Of the cameras in a room: what lengths and rates of the settings are meant for."""


class MappingConfig(BaseModel):
    """Settings of one run; defaults are those of the preset `balanced`.

    Attributes:
        iterations: Steps of the optimisation, each with one frame.
        patience: Share of the schedule in which frames kept aside must gain at full resolution,
            or it ends; 1 means that it never does before its time.
        rough_epochs: Visits of each frame before that, at a quarter of the resolution and with
            Gaussians of twice the size, which only correct poses and lenses.
        budget_s: Instead of a number of steps, the time for reading, seeding and optimising;
            comparing sizes and judging come after it. The map is then not the same each time.
        max_gaussians: No more than so many; None means no limit.
        voxel_m: Edge of the voxels of which each that was measured twice seeds a Gaussian, m.
        seed_contrast: Where colours change by less over larger voxels, these have one Gaussian.
        sh_degree: Of the spherical harmonics, at first.
        max_sh_degree: Up to which it may rise at the end, where that lowers the held-out error.
        variant_steps: With which half and double as many Gaussians, and the next SH degree, are
            refined for comparison; 0 means that they are not tried.
        coarse_share: Share of the iterations at half the resolution.
        growth: Share by which Gaussians become more, by splitting where the images want it.
        fill_holes: Whether Gaussians are put where no depth was measured.
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

    iterations: Annotated[int, Field(gt=0)] = 8000
    patience: Share = 0.25
    rough_epochs: Count = 15
    budget_s: Positive | None = None
    max_gaussians: Annotated[int, Field(gt=0)] | None = None
    voxel_m: Positive = 0.03
    seed_contrast: Rate = 0.2
    sh_degree: Annotated[int, Field(ge=0, le=3)] = 0
    max_sh_degree: Annotated[int, Field(ge=0, le=3)] = 1
    variant_steps: Count = 150
    coarse_share: Share = 0.6
    growth: Rate = 1.0
    fill_holes: bool = True
    refine_poses: bool = True
    refine_lenses: bool = True
    pose_std_m: Positive = 0.03
    pose_std_rad: Positive = 0.03
    dssim_weight: Share = 0.2
    depth_weight: Rate = 0.5
    opacity_weight: Rate = 0.01
    min_opacity: LeastOpacity = 0.02
    max_scale_m: Positive = 0.3
    means_rate: Rate = 2e-3
    quats_rate: Rate = 3e-2
    log_scales_rate: Rate = 6e-2
    logit_opacities_rate: Rate = 8e-2
    sh_rate: Rate = 4e-2
    means_left: Share = 0.05
    rates_left: Share = 0.15
    seed: Count = 0
    threads: Count = 0

    def for_photographs(self, extent_m: float) -> MappingConfig:
        """The settings where no depth says where surfaces are, nor how long a metre is.

        Gaussians must travel farther and keep their shape longer, and what hangs in the air is
        faint. Poses are those of structure from motion, better than a young map could tell, and
        there is no depth lens.

        Args:
            extent_m: Of the cameras, in the unit of their poses; lengths go by it (Kerbl et al.
                2023 scale the rate of the means by it).
        """
        size = extent_m / USUAL_EXTENT_M
        return self.model_copy(
            update={
                "refine_poses": False,
                "refine_lenses": False,
                "fill_holes": False,
                "min_opacity": max(self.min_opacity, 0.05),
                "voxel_m": size * self.voxel_m,
                "max_scale_m": size * self.max_scale_m,
                "means_rate": 2 * size * self.means_rate,
                "log_scales_rate": 0.5 * self.log_scales_rate,
                "quats_rate": 0.5 * self.quats_rate,
            }
        )

    def with_settings(self, settings: Sequence[str]) -> MappingConfig:
        """Other values for some settings, such as "voxel_m=0.02".

        Raises:
            ValueError: There is no such setting, or the value is none for it.
        """
        values = self.model_dump()
        for setting in settings:
            name, equals, value = setting.partition("=")
            if not equals or name not in values:
                raise ValueError(f"{setting}: expected NAME=VALUE, NAME one of {', '.join(values)}")
            values[name] = value
        try:
            return MappingConfig.model_validate(values)
        except ValidationError as error:
            first = error.errors()[0]
            raise ValueError(f"{first['loc'][0]}={first['input']}: {first['msg']}") from None

    def same_map(self, other: MappingConfig) -> bool:
        """Whether both make the same map of the same frames."""
        return self == other.model_copy(update={"threads": self.threads})


PRESETS = {
    "fast": MappingConfig(
        iterations=3600,
        rough_epochs=10,
        voxel_m=0.04,
        seed_contrast=0.4,
        coarse_share=0.94,
        variant_steps=0,
    ),
    "balanced": MappingConfig(),
    "best": MappingConfig(iterations=20_000, coarse_share=0.65, variant_steps=300),
}
"""Speed against accuracy, in three steps."""
