"""Differentiable rendering for PyTorch: `rasterization` takes the place of gsplat's on the CPU.

Names, order, shapes and meanings of the arguments are those of gsplat 1.5. A program changes its
import:

    from gslts.torch import rasterization  # instead of: from gsplat import rasterization

The images are those of gsplat but for rounding and these differences:

* Alpha is at most 0.99, as in 3DGS (Kerbl et al. 2023), where gsplat allows 0.999.
* A Gaussian with z equal to `near_plane` is not seen; in gsplat it is.
* A quaternion shorter than 1e-12 stands for no rotation; in gsplat it yields NaN.
* What is not finite, and an opacity outside of [0, 1], is an error.
* The rotations in `viewmats` are replaced by the nearest ones, and the gradient with respect to
  `viewmats` is that of the result: it is tangent to the rigid transforms, where gsplat's treats
  the entries as independent. For every pose that is a function of parameters, both lead to the
  same gradient of the parameters.
* `meta` holds the sizes only. gsplat's densification strategies need more of it.

Options that gsplat has and this module has not raise NotImplementedError; see `rasterization`.
"""

try:
    import torch  # noqa: F401
except ModuleNotFoundError as error:
    raise ImportError("gslts.torch needs PyTorch: pip install gslts[torch]") from error

from gslts.torch.rasterize import rasterization

__all__ = ["rasterization"]
