"""Differentiable rendering for PyTorch on the CPU: `rasterization`, a replacement for gsplat's.

Names, order, shapes and semantics of the arguments are those of gsplat 1.5. Only the import of a
program changes:

    from gslts.torch import rasterization  # instead of: from gsplat import rasterization

The images equal those of gsplat up to rounding, with these differences:

* Alpha is at most 0.99, as in 3DGS (Kerbl et al. 2023), where gsplat allows 0.999.
* A Gaussian with z equal to `near_plane` is culled; gsplat renders it.
* A quaternion shorter than 1e-12 is the identity; gsplat returns NaN.
* Values that are not finite, and opacities outside [0, 1], are errors.
* The rotations in `viewmats` are projected to the nearest rotation matrices. The gradient with
  respect to `viewmats` is tangent to the rigid transforms, whereas gsplat treats the entries as
  independent. Both give the same gradient of the parameters of a pose.
* `meta` has the sizes only; gsplat's densification strategies need more.

Options of gsplat that are not supported raise NotImplementedError; see `rasterization`.
"""

try:
    import torch  # noqa: F401
except ModuleNotFoundError as error:
    raise ImportError("gslts.torch needs PyTorch: pip install 'gslts[torch]'") from error

from gslts.torch.rasterize import rasterization

__all__ = ["rasterization"]
