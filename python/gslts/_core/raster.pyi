"""
Rendering and its gradients.
"""
from __future__ import annotations
import collections.abc
import gslts._core.map
import numpy
import numpy.typing
import typing
__all__: list[str] = ['RasterizerDouble', 'RasterizerFloat', 'RenderOptions']
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
