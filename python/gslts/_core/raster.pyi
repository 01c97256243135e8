"""
Rendering, losses and their gradients.
"""
from __future__ import annotations
import collections.abc
import gslts._core.map
import numpy
import numpy.typing
import typing
__all__: list[str] = ['AdamDouble', 'AdamFloat', 'AdamOptions', 'AdamRates', 'Exposure', 'RasterizerDouble', 'RasterizerFloat', 'RenderOptions', 'align_double', 'align_float', 'depth_loss_double', 'depth_loss_float', 'fit_exposure_double', 'fit_exposure_float', 'photometric_loss_double', 'photometric_loss_float', 'simd_target', 'simd_targets', 'use_simd_target']
class RenderOptions:
    """
    How to render; immutable.
    
    The defaults are those of 3DGS (Kerbl et al. 2023) but for the near plane and alpha_min, which is
    1/255 there: half of it brings the image 5 dB nearer to the exact one for 4 % of the time.
    
    Args:
        background: RGB behind the Gaussians.
        near_m: Gaussians with centre depth z <= near_m are not seen, m. > 0
        near_sigmas: Gaussians whose depth is at most so many of its standard deviations are not seen:
            projection linearises them at their centre, which fails where they reach the camera's plane,
            and makes fog of a wall beside the camera (the guard band of Kerbl et al. 2023, sec. 6).
            >= 0
        sh_degree: Highest SH degree used, 0 to 3; the map's own degree caps it.
        clamp_colors: Colours below 0 count as 0, as in 3DGS; if false they are kept, and `rgb` is
            linear in `sh`.
        eps2d_px2: Variance added to each projected covariance, px^2. >= 0
        antialias: Scale opacity by sqrt(det(cov2d) / det(cov2d + eps2d I)), so that small or distant
            Gaussians keep their energy (Mip-Splatting, Yu et al. 2024, eq. 9).
        surface_depth: A Gaussian's depth at a pixel is the mean of those of its points that are seen
            there (RaDe-GS, Zhang et al. 2024), so that slanted surfaces are true; if false it is that
            of its centre, as in 3DGS. Where it would change by half within the footprint, that of the
            centre is taken, too.
        alpha_min: A Gaussian is skipped at a pixel where its alpha is below this. In [1e-30, 0.99)
        transmittance_min: A pixel ends before the Gaussian that would take its transmittance below
            this. In [0, 1)
        exp_degree: Degree of the polynomial in the place of exp: 3, with an error of alpha of up to
            8e-5 of it, far below that of the cut-off, or 5, to the precision of float32. float64 always
            takes the exact exp.
        threads: 0 means one a hardware thread. Results do not depend on it.
    
    The values are checked by each rendering.
    """
    __hash__: typing.ClassVar[None] = None
    def __eq__(self, other: RenderOptions) -> bool:
        ...
    def __getstate__(self) -> tuple:
        ...
    def __init__(self, *, background: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"] = [0.0, 0.0, 0.0], near_m: typing.SupportsFloat | typing.SupportsIndex = 0.05, near_sigmas: typing.SupportsFloat | typing.SupportsIndex = 3.0, sh_degree: int = 3, clamp_colors: bool = True, eps2d_px2: typing.SupportsFloat | typing.SupportsIndex = 0.3, antialias: bool = False, surface_depth: bool = True, alpha_min: typing.SupportsFloat | typing.SupportsIndex = 0.001953125, transmittance_min: typing.SupportsFloat | typing.SupportsIndex = 0.0001, exp_degree: int = 3, threads: int = 0) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    @property
    def alpha_min(self) -> float:
        """
        Least alpha that is blended.
        """
    @property
    def antialias(self) -> bool:
        """
        Keep the energy of small Gaussians.
        """
    @property
    def background(self) -> tuple:
        """
        RGB behind the Gaussians.
        """
    @property
    def clamp_colors(self) -> bool:
        """
        Colours below 0 count as 0.
        """
    @property
    def eps2d_px2(self) -> float:
        """
        Variance added to each projected covariance, px^2.
        """
    @property
    def exp_degree(self) -> int:
        """
        Degree of the polynomial for exp.
        """
    @property
    def near_m(self) -> float:
        """
        Near plane, m.
        """
    @property
    def near_sigmas(self) -> float:
        """
        Least depth, in standard deviations of a Gaussian's own.
        """
    @property
    def sh_degree(self) -> int:
        """
        Highest SH degree used.
        """
    @property
    def surface_depth(self) -> bool:
        """
        Depth of what is seen at a pixel and not of the centre.
        """
    @property
    def threads(self) -> int:
        """
        Threads; 0 means one a hardware thread.
        """
    @property
    def transmittance_min(self) -> float:
        """
        Least transmittance left at a pixel.
        """
class RasterizerFloat:
    """
    Rasterizer of one precision; see gslts.Rasterizer.
    """
    def __init__(self) -> None:
        ...
    def backward(self, gaussians: gslts._core.map.GaussianViewFloat, *, dL_drgb: numpy.ndarray | None, dL_ddepth: numpy.ndarray | None, dL_dalpha: numpy.ndarray | None, dL_dfeatures: numpy.ndarray | None, statistics: bool) -> dict[str, numpy.ndarray]:
        """
        Differentiates the last forward; returns the arrays of `gslts.Gradients` by name.
        """
    def forward(self, gaussians: gslts._core.map.GaussianViewFloat, *, camera: gslts._core.map.Camera, options: RenderOptions, mask: numpy.ndarray | None) -> dict[str, numpy.ndarray]:
        """
        Renders one view; returns the arrays of `gslts.Images` by name.
        """
    def lift(self, gaussians: gslts._core.map.GaussianViewFloat, features: numpy.ndarray) -> tuple[numpy.typing.NDArray[numpy.uint32], numpy.typing.NDArray[numpy.float32], numpy.typing.NDArray[numpy.float32]]:
        """
        Lifts onto what the last forward saw; returns the arrays of `gslts.LiftedFeatures`.
        """
class RasterizerDouble:
    """
    Rasterizer of one precision; see gslts.Rasterizer.
    """
    def __init__(self) -> None:
        ...
    def backward(self, gaussians: gslts._core.map.GaussianViewDouble, *, dL_drgb: numpy.ndarray | None, dL_ddepth: numpy.ndarray | None, dL_dalpha: numpy.ndarray | None, dL_dfeatures: numpy.ndarray | None, statistics: bool) -> dict[str, numpy.ndarray]:
        """
        Differentiates the last forward; returns the arrays of `gslts.Gradients` by name.
        """
    def forward(self, gaussians: gslts._core.map.GaussianViewDouble, *, camera: gslts._core.map.Camera, options: RenderOptions, mask: numpy.ndarray | None) -> dict[str, numpy.ndarray]:
        """
        Renders one view; returns the arrays of `gslts.Images` by name.
        """
    def lift(self, gaussians: gslts._core.map.GaussianViewDouble, features: numpy.ndarray) -> tuple[numpy.typing.NDArray[numpy.uint32], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        Lifts onto what the last forward saw; returns the arrays of `gslts.LiftedFeatures`.
        """
class Exposure:
    """
    Colour correction of one photograph; immutable.
    
    photograph = gain * rendering + offset, for each channel.
    
    Args:
        gain: Of red, green and blue.
        offset: Of red, green and blue.
    """
    __hash__: typing.ClassVar[None] = None
    def __eq__(self, other: Exposure) -> bool:
        ...
    def __init__(self, *, gain: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"] = [1.0, 1.0, 1.0], offset: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"] = [0.0, 0.0, 0.0]) -> None:
        ...
    def __repr__(self) -> str:
        ...
    @property
    def gain(self) -> tuple:
        """
        Of red, green and blue.
        """
    @property
    def offset(self) -> tuple:
        """
        Of red, green and blue.
        """
class AdamOptions:
    """
    Constants of Adam; immutable.
    
    Args:
        beta1: Decay of the first moment, in [0, 1).
        beta2: Decay of the second moment, in [0, 1).
        eps: Positive; 3DGS's value, as gradients of a mean over pixels are tiny.
    """
    def __init__(self, *, beta1: typing.SupportsFloat | typing.SupportsIndex = 0.9, beta2: typing.SupportsFloat | typing.SupportsIndex = 0.999, eps: typing.SupportsFloat | typing.SupportsIndex = 1e-15) -> None:
        ...
    @property
    def beta1(self) -> float:
        """
        Decay of the first moment.
        """
    @property
    def beta2(self) -> float:
        """
        Decay of the second moment.
        """
    @property
    def eps(self) -> float:
        """
        Added to the root of the second moment.
        """
class AdamRates:
    """
    Learning rates by group of parameters; immutable.
    
    A group with rate 0 stays, and so do its moments.
    
    Args:
        means: Of the centres, m.
        quats: Of the rotations.
        log_scales: Of the logarithms of the scales.
        logit_opacities: Of the logits of the opacities.
        sh_dc: Of the three SH coefficients of degree 0.
        sh_rest: Of all other SH coefficients.
        features: Of the semantic features.
    """
    def __init__(self, *, means: typing.SupportsFloat | typing.SupportsIndex = 0.0, quats: typing.SupportsFloat | typing.SupportsIndex = 0.0, log_scales: typing.SupportsFloat | typing.SupportsIndex = 0.0, logit_opacities: typing.SupportsFloat | typing.SupportsIndex = 0.0, sh_dc: typing.SupportsFloat | typing.SupportsIndex = 0.0, sh_rest: typing.SupportsFloat | typing.SupportsIndex = 0.0, features: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        ...
    @property
    def features(self) -> float:
        """
        Of the semantic features.
        """
    @property
    def log_scales(self) -> float:
        """
        Of the logarithms of the scales.
        """
    @property
    def logit_opacities(self) -> float:
        """
        Of the logits of the opacities.
        """
    @property
    def means(self) -> float:
        """
        Of the centres, m.
        """
    @property
    def quats(self) -> float:
        """
        Of the rotations.
        """
    @property
    def sh_dc(self) -> float:
        """
        Of the SH coefficients of degree 0.
        """
    @property
    def sh_rest(self) -> float:
        """
        Of all other SH coefficients.
        """
class AdamFloat:
    """
    Adam over a map of one precision; see gslts.Adam.
    """
    @typing.overload
    def __init__(self, gaussians: gslts._core.map.GaussianViewFloat, *, options: AdamOptions) -> None:
        ...
    @typing.overload
    def __init__(self, gaussians: gslts._core.map.GaussianViewFloat, *, first: numpy.ndarray, second: numpy.ndarray, steps: numpy.ndarray, options: AdamOptions) -> None:
        ...
    def arrays(self) -> dict[str, numpy.ndarray]:
        """
        The arrays of the map by name, as they are now and after every step.
        """
    def select(self, rows: numpy.ndarray) -> tuple[numpy.typing.NDArray[numpy.float32], numpy.typing.NDArray[numpy.float32], numpy.typing.NDArray[numpy.uint32]]:
        """
        The state of a map whose Gaussian i was Gaussian rows[i], or is new if that is -1.
        """
    def state(self) -> tuple[numpy.typing.NDArray[numpy.float32], numpy.typing.NDArray[numpy.float32], numpy.typing.NDArray[numpy.uint32]]:
        """
        Copies of the moments and steps.
        """
    def step(self, *, rows: numpy.ndarray, dL_dmeans: numpy.ndarray, dL_dquats: numpy.ndarray, dL_dlog_scales: numpy.ndarray, dL_dlogit_opacities: numpy.ndarray, dL_dsh: numpy.ndarray, dL_dfeatures: numpy.ndarray, rates: AdamRates, threads: int) -> None:
        """
        Moves the Gaussians at `rows`.
        """
class AdamDouble:
    """
    Adam over a map of one precision; see gslts.Adam.
    """
    @typing.overload
    def __init__(self, gaussians: gslts._core.map.GaussianViewDouble, *, options: AdamOptions) -> None:
        ...
    @typing.overload
    def __init__(self, gaussians: gslts._core.map.GaussianViewDouble, *, first: numpy.ndarray, second: numpy.ndarray, steps: numpy.ndarray, options: AdamOptions) -> None:
        ...
    def arrays(self) -> dict[str, numpy.ndarray]:
        """
        The arrays of the map by name, as they are now and after every step.
        """
    def select(self, rows: numpy.ndarray) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint32]]:
        """
        The state of a map whose Gaussian i was Gaussian rows[i], or is new if that is -1.
        """
    def state(self) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint32]]:
        """
        Copies of the moments and steps.
        """
    def step(self, *, rows: numpy.ndarray, dL_dmeans: numpy.ndarray, dL_dquats: numpy.ndarray, dL_dlog_scales: numpy.ndarray, dL_dlogit_opacities: numpy.ndarray, dL_dsh: numpy.ndarray, dL_dfeatures: numpy.ndarray, rates: AdamRates, threads: int) -> None:
        """
        Moves the Gaussians at `rows`.
        """
def align_double(camera: gslts._core.map.Camera, rgb: numpy.ndarray, depth: numpy.ndarray, photo: numpy.ndarray, measured: numpy.ndarray, *, mask: numpy.ndarray | None, exposure: Exposure, threads: int) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 10]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 1]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 10]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 1]"]]:
    """
    See gslts.alignment.align; returns hessian and right side of colour and of depth.
    """
def align_float(camera: gslts._core.map.Camera, rgb: numpy.ndarray, depth: numpy.ndarray, photo: numpy.ndarray, measured: numpy.ndarray, *, mask: numpy.ndarray | None, exposure: Exposure, threads: int) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 10]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 1]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 10]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[10, 1]"]]:
    """
    See gslts.alignment.align; returns hessian and right side of colour and of depth.
    """
def depth_loss_double(depth: numpy.ndarray, target: numpy.ndarray, *, mask: numpy.ndarray | None, relative: bool, threads: int) -> tuple[float, int, numpy.typing.NDArray[numpy.float64]]:
    """
    See gslts.losses.depth_loss; returns value, count and gradient.
    """
def depth_loss_float(depth: numpy.ndarray, target: numpy.ndarray, *, mask: numpy.ndarray | None, relative: bool, threads: int) -> tuple[float, int, numpy.typing.NDArray[numpy.float32]]:
    """
    See gslts.losses.depth_loss; returns value, count and gradient.
    """
def fit_exposure_double(rgb: numpy.ndarray, target: numpy.ndarray, *, mask: numpy.ndarray | None, threads: int) -> Exposure:
    """
    See gslts.losses.fit_exposure.
    """
def fit_exposure_float(rgb: numpy.ndarray, target: numpy.ndarray, *, mask: numpy.ndarray | None, threads: int) -> Exposure:
    """
    See gslts.losses.fit_exposure.
    """
def photometric_loss_double(rgb: numpy.ndarray, target: numpy.ndarray, *, mask: numpy.ndarray | None, dssim_weight: typing.SupportsFloat | typing.SupportsIndex, exposure: Exposure, threads: int) -> tuple[float, float, float, numpy.typing.NDArray[numpy.float64]]:
    """
    See gslts.losses.photometric_loss; returns value, l1, ssim and gradient.
    """
def photometric_loss_float(rgb: numpy.ndarray, target: numpy.ndarray, *, mask: numpy.ndarray | None, dssim_weight: typing.SupportsFloat | typing.SupportsIndex, exposure: Exposure, threads: int) -> tuple[float, float, float, numpy.typing.NDArray[numpy.float32]]:
    """
    See gslts.losses.photometric_loss; returns value, l1, ssim and gradient.
    """
def simd_target() -> str:
    """
    Name of the instruction set that the kernels use: sse4, avx2, avx512 or neon.
    """
def simd_targets() -> list[str]:
    """
    Names of the instruction sets that this machine can use, the best first.
    """
def use_simd_target(name: str) -> None:
    """
    Makes the kernels use an instruction set from now on. Call it while no kernel runs.
    """
