"""What the arguments of `rasterization` must be."""

from __future__ import annotations

import torch
from torch import Tensor

ANY = -1  # In an expected shape: of any length.


def require_supported(**options: tuple[object, bool]) -> None:
    """Raises for an option whose value is not supported; each comes as (value, whether it is)."""
    for name, (value, supported) in options.items():
        if not supported:
            shown = f"a tensor {tuple(value.shape)}" if isinstance(value, Tensor) else repr(value)
            raise NotImplementedError(f"rasterization: {name}={shown} is not supported")


def require_valid(**options: tuple[object, bool, str]) -> None:
    """Raises ValueError for a bad value; each option comes as (value, is it valid, expected)."""
    for name, (value, valid, expected) in options.items():
        if not valid:
            raise ValueError(f"{name}: expected {expected}, got {value!r}")


def require_finite(**tensors: Tensor) -> None:
    """Raises ValueError for the first tensor that holds a number that is not finite."""
    for name, tensor in tensors.items():
        finite = tensor.isfinite()
        if not finite.all():
            raise ValueError(f"{name}: expected finite numbers, got {tensor[~finite][0].item()}")


def check_tensors(*, backgrounds: Tensor | None, sh_degree: int | None, **tensors: Tensor) -> None:
    """Raises unless the tensors of `rasterization`, by name, have what its docstring asks for.

    That is their dtypes, devices and shapes, and the range of the opacities.
    """
    if backgrounds is not None:
        tensors["backgrounds"] = backgrounds
    for name, tensor in tensors.items():
        if not isinstance(tensor, Tensor):
            raise TypeError(f"{name}: expected a tensor, got {type(tensor).__name__}")
    means, opacities, colors, viewmats, Ks = (
        tensors[name] for name in ("means", "opacities", "colors", "viewmats", "Ks")
    )
    # Slices, because a tensor may have too few dimensions.
    batch, size, cameras = means.shape[:-2], means.shape[-2:-1], viewmats.shape[-3:-2]
    color = (ANY,) if sh_degree is None else (ANY, 3)
    shapes = {
        "means": [(*batch, ANY, 3)],
        "quats": [(*batch, *size, 4)],
        "scales": [(*batch, *size, 3)],
        "opacities": [(*batch, *size)],
        "colors": [(*batch, *size, *color), (*batch, *cameras, *size, *color)],
        "viewmats": [(*batch, ANY, 4, 4)],
        "Ks": [(*batch, *cameras, 3, 3)],
        "backgrounds": [(*batch, *cameras, *colors.shape[-1:])],
    }
    dtype = torch.float64 if means.dtype == torch.float64 else torch.float32
    for name, tensor in tensors.items():
        fits = any(_fits(tensor.shape, shape) for shape in shapes[name])
        if not fits or tensor.dtype != dtype or tensor.device.type != "cpu":
            expected = " or ".join(str(shape).replace(str(ANY), "*") for shape in shapes[name])
            raise ValueError(
                f"{name}: expected {dtype} {expected} on cpu, "
                f"got {tensor.dtype} {tuple(tensor.shape)} on {tensor.device}"
            )
    if viewmats.numel() == 0:
        raise ValueError(f"viewmats: expected at least one, got {tuple(viewmats.shape)}")
    if sh_degree is not None and colors.shape[-2] < (sh_degree + 1) ** 2:
        raise ValueError(
            f"colors: expected at least {(sh_degree + 1) ** 2} spherical harmonics for sh_degree="
            f"{sh_degree}, got {tuple(colors.shape)}"
        )
    if opacities.numel() > 0:
        least, greatest = torch.aminmax(opacities)
        if not (least >= 0 and greatest <= 1):
            raise ValueError(
                f"opacities: expected numbers in [0, 1], got {least.item()} to {greatest.item()}"
            )
    if Ks.requires_grad and torch.is_grad_enabled():
        raise NotImplementedError("rasterization: a gradient with respect to Ks is not supported")


def _fits(shape: tuple[int, ...], expected: tuple[int, ...]) -> bool:
    return len(shape) == len(expected) and all(
        wanted in (ANY, length) for length, wanted in zip(shape, expected, strict=True)
    )
