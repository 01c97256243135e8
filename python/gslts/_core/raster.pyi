"""
Rendering and its gradients.
"""
from __future__ import annotations
import collections.abc
import gslts._core.map
import numpy
import numpy.typing
import typing
__all__: list[str] = ['RasterizerDouble', 'RasterizerFloat', 'RenderOptions', 'chunks_in_view']
class RenderOptions:
    """
    Options of rendering; immutable. Each rendering checks the values.
    
    The defaults are those of 3DGS (Kerbl et al. 2023) but for the near plane and alpha_min, which is
    1/255 there: half of it brings the image 5 dB nearer to the exact one for 4 % of the time.
    
    Args:
        background: RGB behind the Gaussians.
        near_m: Near plane: Gaussians with centre depth z <= near_m are culled, m. > 0
        far_m: Far plane: Gaussians with centre depth z > far_m are culled, m. > near_m
        near_sigmas: Gaussians within so many standard deviations of depth of the camera are culled: the
            affine projection is invalid there, and turns a wall beside the camera into fog (the guard
            band of Kerbl et al. 2023, sec. 6). >= 0
        sh_degree: Maximum SH degree used, 0 to 3; the map's own degree caps it.
        clamp_colors: Colours below 0 count as 0, as in 3DGS; if false they are kept, and `rgb` is
            linear in `sh`.
        eps2d_px2: Variance added to each projected covariance, px^2. >= 0
        antialias: Scale opacity by sqrt(det(cov2d) / det(cov2d + eps2d I)), so that small or distant
            Gaussians keep their energy (Mip-Splatting, Yu et al. 2024, eq. 9).
        surface_depth: A Gaussian's depth changes across its footprint as that of its visible points
            (RaDe-GS, Zhang et al. 2024), so that slanted surfaces are exact; if false it is that of its
            centre, as in 3DGS. Where it would change by half within the footprint, it is that of the
            centre, too.
        alpha_min: Minimum alpha of a Gaussian that is blended at a pixel. In [1e-30, 0.99)
        transmittance_min: Minimum transmittance of a pixel; it ends before the Gaussian that would
            leave less. In [0, 1)
        exp_degree: Degree of the polynomial that replaces exp: 3, with a relative error of alpha of up
            to 8e-5, far below that of alpha_min, or 5, to the precision of float32. float64 always
            takes the exact exp.
        threads: Number of threads; 0: one a hardware thread. Results do not depend on it.
    """
    __hash__: typing.ClassVar[None] = None
    def __eq__(self, other: RenderOptions) -> bool:
        ...
    def __getstate__(self) -> tuple:
        ...
    def __init__(self, *, background: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"] = [0.0, 0.0, 0.0], near_m: typing.SupportsFloat | typing.SupportsIndex = 0.05, far_m: typing.SupportsFloat | typing.SupportsIndex = ..., near_sigmas: typing.SupportsFloat | typing.SupportsIndex = 3.0, sh_degree: int = 3, clamp_colors: bool = True, eps2d_px2: typing.SupportsFloat | typing.SupportsIndex = 0.3, antialias: bool = False, surface_depth: bool = True, alpha_min: typing.SupportsFloat | typing.SupportsIndex = 0.001953125, transmittance_min: typing.SupportsFloat | typing.SupportsIndex = 0.0001, exp_degree: int = 3, threads: int = 0) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    @property
    def alpha_min(self) -> float:
        ...
    @property
    def antialias(self) -> bool:
        ...
    @property
    def background(self) -> tuple:
        ...
    @property
    def clamp_colors(self) -> bool:
        ...
    @property
    def eps2d_px2(self) -> float:
        ...
    @property
    def exp_degree(self) -> int:
        ...
    @property
    def far_m(self) -> float:
        ...
    @property
    def near_m(self) -> float:
        ...
    @property
    def near_sigmas(self) -> float:
        ...
    @property
    def sh_degree(self) -> int:
        ...
    @property
    def surface_depth(self) -> bool:
        ...
    @property
    def threads(self) -> int:
        ...
    @property
    def transmittance_min(self) -> float:
        ...
class RasterizerFloat:
    """
    Rasterizer of one precision; see `gslts.rendering.Rasterizer`.
    """
    def __init__(self) -> None:
        ...
    def backward(self, gaussians: gslts._core.map.GaussianViewFloat, *, dL_drgb: numpy.ndarray | None, dL_ddepth: numpy.ndarray | None, dL_dalpha: numpy.ndarray | None, dL_dfeatures: numpy.ndarray | None, statistics: bool) -> dict[str, numpy.ndarray]:
        """
        Differentiate the last `forward`.
        
        Args:
            gaussians: The same Gaussians, unchanged since.
            dL_drgb: [H,W,3] gradient of the loss; None: the loss ignores the image.
            dL_ddepth: [H,W], 1/m, or None.
            dL_dalpha: [H,W] or None.
            dL_dfeatures: [H,W,D] or None.
            statistics: Also return abs_dL_dmeans2d, max_weights and pixel_counts.
        
        Returns:
            Arrays of `gslts.rendering.Gradients` by name.
        
        Raises:
            ValueError: The sizes differ from those of the forward, or a gradient is not finite.
            RuntimeError: There was no forward, or another thread uses the rasterizer.
        """
    def forward(self, gaussians: gslts._core.map.GaussianViewFloat, *, camera: gslts._core.map.Camera, options: RenderOptions, mask: numpy.ndarray | None) -> dict[str, numpy.ndarray]:
        """
        Render one view.
        
        Args:
            gaussians: N Gaussians.
            camera: Of the view.
            options: How to render.
            mask: [H,W] bool, True at pixels to render; None: all.
        
        Returns:
            Arrays of `gslts.rendering.Images` by name.
        
        Raises:
            ValueError: An option is out of range, the mask does not fit the camera, or a number of the
                Gaussians is not finite.
            RuntimeError: The Gaussians in view touch too many tiles, or another thread uses the rasterizer.
        """
    def lift(self, gaussians: gslts._core.map.GaussianViewFloat, features: numpy.ndarray) -> tuple[numpy.typing.NDArray[numpy.uint32], numpy.typing.NDArray[numpy.float32], numpy.typing.NDArray[numpy.float32]]:
        """
        Lift a feature image of the last `forward`'s view to the Gaussians.
        
        Args:
            gaussians: The same Gaussians, unchanged since.
            features: [H,W,D] features of the pixels; those outside the mask are ignored.
        
        Returns:
            rows: [V] uint32, rows of the visible Gaussians, ascending.
            weighted_features: [V,D] sum over the pixels of blend weight times feature.
            weights: [V] sum over the pixels of the blend weights.
        
        Raises:
            ValueError: The sizes differ from those of the forward, or a feature is not finite.
            RuntimeError: There was no forward, or another thread uses the rasterizer.
        """
class RasterizerDouble:
    """
    Rasterizer of one precision; see `gslts.rendering.Rasterizer`.
    """
    def __init__(self) -> None:
        ...
    def backward(self, gaussians: gslts._core.map.GaussianViewDouble, *, dL_drgb: numpy.ndarray | None, dL_ddepth: numpy.ndarray | None, dL_dalpha: numpy.ndarray | None, dL_dfeatures: numpy.ndarray | None, statistics: bool) -> dict[str, numpy.ndarray]:
        """
        Differentiate the last `forward`.
        
        Args:
            gaussians: The same Gaussians, unchanged since.
            dL_drgb: [H,W,3] gradient of the loss; None: the loss ignores the image.
            dL_ddepth: [H,W], 1/m, or None.
            dL_dalpha: [H,W] or None.
            dL_dfeatures: [H,W,D] or None.
            statistics: Also return abs_dL_dmeans2d, max_weights and pixel_counts.
        
        Returns:
            Arrays of `gslts.rendering.Gradients` by name.
        
        Raises:
            ValueError: The sizes differ from those of the forward, or a gradient is not finite.
            RuntimeError: There was no forward, or another thread uses the rasterizer.
        """
    def forward(self, gaussians: gslts._core.map.GaussianViewDouble, *, camera: gslts._core.map.Camera, options: RenderOptions, mask: numpy.ndarray | None) -> dict[str, numpy.ndarray]:
        """
        Render one view.
        
        Args:
            gaussians: N Gaussians.
            camera: Of the view.
            options: How to render.
            mask: [H,W] bool, True at pixels to render; None: all.
        
        Returns:
            Arrays of `gslts.rendering.Images` by name.
        
        Raises:
            ValueError: An option is out of range, the mask does not fit the camera, or a number of the
                Gaussians is not finite.
            RuntimeError: The Gaussians in view touch too many tiles, or another thread uses the rasterizer.
        """
    def lift(self, gaussians: gslts._core.map.GaussianViewDouble, features: numpy.ndarray) -> tuple[numpy.typing.NDArray[numpy.uint32], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        Lift a feature image of the last `forward`'s view to the Gaussians.
        
        Args:
            gaussians: The same Gaussians, unchanged since.
            features: [H,W,D] features of the pixels; those outside the mask are ignored.
        
        Returns:
            rows: [V] uint32, rows of the visible Gaussians, ascending.
            weighted_features: [V,D] sum over the pixels of blend weight times feature.
            weights: [V] sum over the pixels of the blend weights.
        
        Raises:
            ValueError: The sizes differ from those of the forward, or a feature is not finite.
            RuntimeError: There was no forward, or another thread uses the rasterizer.
        """
@typing.overload
def chunks_in_view(gaussians: gslts._core.map.GaussianViewFloat, camera: gslts._core.map.Camera, options: RenderOptions) -> numpy.typing.NDArray[numpy.uint32]:
    """
    List the chunks [C] of a map that a rendering reads, ascending; all if it has no bounds.
    """
@typing.overload
def chunks_in_view(gaussians: gslts._core.map.GaussianViewDouble, camera: gslts._core.map.Camera, options: RenderOptions) -> numpy.typing.NDArray[numpy.uint32]:
    """
    List the chunks [C] of a map that a rendering reads, ascending; all if it has no bounds.
    """
