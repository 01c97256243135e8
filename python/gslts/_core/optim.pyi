"""
Adam, and losses of images.
"""
from __future__ import annotations
import collections.abc
import gslts._core.map
import numpy
import numpy.typing
import typing
__all__: list[str] = ['AdamDouble', 'AdamFloat', 'AdamOptions', 'AdamRates', 'Exposure', 'depth_loss_double', 'depth_loss_float', 'fit_exposure_double', 'fit_exposure_float', 'photometric_loss_double', 'photometric_loss_float']
class AdamOptions:
    """
    Constants of Adam; immutable.
    
    Args:
        beta1: Decay of the first moment, in [0, 1).
        beta2: Decay of the second moment, in [0, 1).
        eps: Positive; 3DGS's value, as gradients of a mean over pixels are tiny.
    """
    def __getstate__(self) -> tuple[float, float, float]:
        ...
    def __init__(self, *, beta1: typing.SupportsFloat | typing.SupportsIndex = 0.9, beta2: typing.SupportsFloat | typing.SupportsIndex = 0.999, eps: typing.SupportsFloat | typing.SupportsIndex = 1e-15) -> None:
        ...
    def __setstate__(self, arg0: tuple) -> None:
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
    
    A group with rate 0, its moments and its number of steps stay unchanged.
    
    Args:
        means: Centres, m.
        quats: Rotations.
        log_scales: Logarithms of the scales.
        logit_opacities: Logits of the opacities.
        sh_dc: The three SH coefficients of degree 0.
        sh_rest: All other SH coefficients.
        features: Semantic features.
    """
    def __getstate__(self) -> tuple[float, float, float, float, float, float, float]:
        ...
    def __init__(self, *, means: typing.SupportsFloat | typing.SupportsIndex = 0.0, quats: typing.SupportsFloat | typing.SupportsIndex = 0.0, log_scales: typing.SupportsFloat | typing.SupportsIndex = 0.0, logit_opacities: typing.SupportsFloat | typing.SupportsIndex = 0.0, sh_dc: typing.SupportsFloat | typing.SupportsIndex = 0.0, sh_rest: typing.SupportsFloat | typing.SupportsIndex = 0.0, features: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    @property
    def features(self) -> float:
        """
        Semantic features.
        """
    @property
    def log_scales(self) -> float:
        """
        Logarithms of the scales.
        """
    @property
    def logit_opacities(self) -> float:
        """
        Logits of the opacities.
        """
    @property
    def means(self) -> float:
        """
        Centres, m.
        """
    @property
    def quats(self) -> float:
        """
        Rotations.
        """
    @property
    def sh_dc(self) -> float:
        """
        SH coefficients of degree 0.
        """
    @property
    def sh_rest(self) -> float:
        """
        All other SH coefficients.
        """
class AdamFloat:
    """
    Adam over a map of one precision; see gslts.rendering.adam.Adam.
    """
    @typing.overload
    def __init__(self, gaussians: gslts._core.map.GaussianViewFloat, *, options: AdamOptions) -> None:
        ...
    @typing.overload
    def __init__(self, gaussians: gslts._core.map.GaussianViewFloat, *, first: numpy.ndarray, second: numpy.ndarray, steps: numpy.ndarray, options: AdamOptions) -> None:
        ...
    def arrays(self) -> dict[str, numpy.ndarray]:
        """
        Return the arrays of the map by name; they change with every step.
        """
    def select(self, rows: numpy.ndarray) -> tuple[numpy.typing.NDArray[numpy.float32], numpy.typing.NDArray[numpy.float32], numpy.typing.NDArray[numpy.uint32]]:
        """
        Return the state for a map whose Gaussian i was Gaussian rows[i], or is new if that is -1.
        """
    def state(self) -> tuple[numpy.typing.NDArray[numpy.float32], numpy.typing.NDArray[numpy.float32], numpy.typing.NDArray[numpy.uint32]]:
        """
        Return copies of the moments and steps.
        """
    def step(self, *, rows: numpy.ndarray, dL_dmeans: numpy.ndarray, dL_dquats: numpy.ndarray, dL_dlog_scales: numpy.ndarray, dL_dlogit_opacities: numpy.ndarray, dL_dsh: numpy.ndarray, dL_dfeatures: numpy.ndarray, rates: AdamRates, threads: int) -> None:
        """
        Update the Gaussians at `rows`.
        """
class AdamDouble:
    """
    Adam over a map of one precision; see gslts.rendering.adam.Adam.
    """
    @typing.overload
    def __init__(self, gaussians: gslts._core.map.GaussianViewDouble, *, options: AdamOptions) -> None:
        ...
    @typing.overload
    def __init__(self, gaussians: gslts._core.map.GaussianViewDouble, *, first: numpy.ndarray, second: numpy.ndarray, steps: numpy.ndarray, options: AdamOptions) -> None:
        ...
    def arrays(self) -> dict[str, numpy.ndarray]:
        """
        Return the arrays of the map by name; they change with every step.
        """
    def select(self, rows: numpy.ndarray) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint32]]:
        """
        Return the state for a map whose Gaussian i was Gaussian rows[i], or is new if that is -1.
        """
    def state(self) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint32]]:
        """
        Return copies of the moments and steps.
        """
    def step(self, *, rows: numpy.ndarray, dL_dmeans: numpy.ndarray, dL_dquats: numpy.ndarray, dL_dlog_scales: numpy.ndarray, dL_dlogit_opacities: numpy.ndarray, dL_dsh: numpy.ndarray, dL_dfeatures: numpy.ndarray, rates: AdamRates, threads: int) -> None:
        """
        Update the Gaussians at `rows`.
        """
class Exposure:
    """
    Colour correction of one image; immutable.
    
    observed = gain * rendered + offset, for each channel.
    
    Args:
        gain: Factors of red, green and blue.
        offset: Offsets of red, green and blue.
    """
    __hash__: typing.ClassVar[None] = None
    def __eq__(self, other: Exposure) -> bool:
        ...
    def __getstate__(self) -> tuple:
        ...
    def __init__(self, *, gain: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"] = [1.0, 1.0, 1.0], offset: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"] = [0.0, 0.0, 0.0]) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    @property
    def gain(self) -> tuple:
        """
        Factors of red, green and blue.
        """
    @property
    def offset(self) -> tuple:
        """
        Offsets of red, green and blue.
        """
def depth_loss_double(depth: numpy.ndarray, target: numpy.ndarray, *, mask: numpy.ndarray | None, relative: bool, threads: int) -> tuple[float, int, numpy.typing.NDArray[numpy.float64]]:
    """
    See gslts.rendering.losses.depth_loss; returns value, count and gradient.
    """
def depth_loss_float(depth: numpy.ndarray, target: numpy.ndarray, *, mask: numpy.ndarray | None, relative: bool, threads: int) -> tuple[float, int, numpy.typing.NDArray[numpy.float32]]:
    """
    See gslts.rendering.losses.depth_loss; returns value, count and gradient.
    """
def fit_exposure_double(rgb: numpy.ndarray, target: numpy.ndarray, *, mask: numpy.ndarray | None, threads: int) -> Exposure:
    """
    See gslts.rendering.losses.fit_exposure.
    """
def fit_exposure_float(rgb: numpy.ndarray, target: numpy.ndarray, *, mask: numpy.ndarray | None, threads: int) -> Exposure:
    """
    See gslts.rendering.losses.fit_exposure.
    """
def photometric_loss_double(rgb: numpy.ndarray, target: numpy.ndarray, *, mask: numpy.ndarray | None, dssim_weight: typing.SupportsFloat | typing.SupportsIndex, exposure: Exposure, threads: int) -> tuple[float, float, float, numpy.typing.NDArray[numpy.float64]]:
    """
    See gslts.rendering.losses.photometric_loss; returns value, l1, ssim and gradient.
    """
def photometric_loss_float(rgb: numpy.ndarray, target: numpy.ndarray, *, mask: numpy.ndarray | None, dssim_weight: typing.SupportsFloat | typing.SupportsIndex, exposure: Exposure, threads: int) -> tuple[float, float, float, numpy.typing.NDArray[numpy.float32]]:
    """
    See gslts.rendering.losses.photometric_loss; returns value, l1, ssim and gradient.
    """
