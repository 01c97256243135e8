"""Settings of the mapping engine and its presets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

Share = Annotated[float, Field(ge=0, le=1)]
Opacity = Annotated[float, Field(ge=0, lt=1)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Rate = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0)]

USUAL_EXTENT_M = 2.0
"""Extent of the cameras in a room, m, for which lengths and rates of the defaults are chosen; those
of photographs without a metric scale are multiplied by their extent over this one."""


class MappingConfig(BaseModel):
    """Settings of one run of the mapping engine; the defaults are those of the preset `balanced`.

    Attributes:
        iterations: Number of optimization steps; each step fits one frame.
        patience: Share of the schedule in which the validation PSNR must rise at full resolution;
            otherwise optimization ends early. 1 turns this off.
        rough_epochs: Epochs of a first optimization of poses and lenses, at a quarter of the
            resolution and with Gaussians of twice the size.
        budget_s: Time limit for reading, seeding and optimizing, s; replaces `iterations`. Size
            comparison and evaluation come on top. The result then depends on the machine.
        max_gaussians: Maximum number of Gaussians; None means no limit.
        voxel_m: Edge of the voxels that seed one Gaussian each, m.
        seed_contrast: Colour contrast (of 1) below which a larger voxel seeds one Gaussian.
        sh_degree: Degree of the spherical harmonics during optimization.
        max_sh_degree: Degree up to which harmonics are added at the end, if that raises the
            validation PSNR.
        variant_steps: Refinement steps of each variant (half and double the number of Gaussians,
            next SH degree); 0 turns the comparison off.
        coarse_share: Share of the schedule at half resolution.
        growth: Relative growth of the number of Gaussians by splitting.
        fill_holes: Whether Gaussians are added where no depth was measured.
        refine_poses: Whether camera poses are refined.
        refine_lenses: Whether focal lengths, principal point and the pose of the depth lens are
            refined, together with the poses: not without `refine_poses`.
        pose_std_m: Prior standard deviation of the given camera positions, m.
        pose_std_rad: Prior standard deviation of the given rotations, rad.
        dssim_weight: Weight of 1 - SSIM against L1 of the colours.
        depth_weight: Weight of the relative depth error.
        opacity_weight: Weight of 1 - alpha, which closes holes.
        min_opacity: Gaussians with a lower opacity are pruned.
        max_scale_m: Maximum standard deviation of a Gaussian, m.
        means_rate, quats_rate, log_scales_rate, logit_opacities_rate, sh_rate: Learning rates of
            Adam at the start.
        means_left: Share of means_rate that is left at the end (exponential decay).
        rates_left: The same share for all other rates.
        seed: Seed of the order of the frames and of random backgrounds.
        threads: Number of threads; 0 means all.
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
    min_opacity: Opacity = 0.02
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
        """Return settings for images without depth, which have no metric scale either.

        Gaussians must move farther and should keep their shape longer, and floaters are faint.
        Poses are kept: those of structure from motion are better than an early map can refine.

        Args:
            extent_m: Extent of the cameras, in the unit of their poses; scales all lengths (Kerbl
                et al. 2023 scale the rate of the means by it).
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
        """Return a copy with other values.

        Args:
            settings: Each NAME=VALUE, such as "voxel_m=0.02".

        Raises:
            ValueError: A name is unknown or a value is out of range.
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
        """Return whether both make the same map of the same frames.

        Args:
            other: Settings to compare with; the number of threads does not matter.
        """
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
"""Speed against accuracy, in three steps. `fast` takes larger Gaussians and half the steps,
`best` 2.5 times the steps."""
