"""Validation of the arguments of `rasterization`."""

from __future__ import annotations

import torch
from torch import Tensor

ANY = -1
"""Stands for any length in an expected shape."""


def require_supported(**options: tuple[object, bool]) -> None:
    """Reject unsupported options.

    Args:
        options: By name, the value and True if it is supported.

    Raises:
        NotImplementedError: A value is not supported.
    """
    for name, (value, supported) in options.items():
        if not supported:
            shown = f"a tensor {tuple(value.shape)}" if isinstance(value, Tensor) else repr(value)
            raise NotImplementedError(f"rasterization: {name}={shown} is not supported")


def require_valid(**options: tuple[object, bool, str]) -> None:
    """Reject invalid options.

    Args:
        options: By name, the value, True if it is valid, and a description of valid values.

    Raises:
        ValueError: A value is not valid.
    """
    for name, (value, valid, expected) in options.items():
        if not valid:
            raise ValueError(f"{name}: expected {expected}, got {value!r}")


def require_finite(**tensors: Tensor) -> None:
    """Reject tensors with values that are not finite.

    Args:
        tensors: By name.

    Raises:
        ValueError: A value is not finite.
    """
    for name, tensor in tensors.items():
        finite = tensor.isfinite()
        if not finite.all():
            raise ValueError(f"{name}: expected finite numbers, got {tensor[~finite][0].item()}")


def check_tensors(*, backgrounds: Tensor | None, sh_degree: int | None, **tensors: Tensor) -> None:
    """Check types, dtypes, devices and shapes of tensors, and the range of opacities.

    Args:
        backgrounds: Argument of `rasterization`.
        sh_degree: Argument of `rasterization`.
        tensors: The other tensors of `rasterization`, by name.

    Raises:
        TypeError: A value is not a tensor.
        ValueError: A tensor does not match the description in `rasterization`.
        NotImplementedError: `Ks` requires a gradient.
    """
    if backgrounds is not None:
        tensors["backgrounds"] = backgrounds
    for name, tensor in tensors.items():
        if not isinstance(tensor, Tensor):
            raise TypeError(f"{name}: expected a tensor, got {type(tensor).__name__}")
    means, opacities, colors, viewmats, Ks = (
        tensors[name] for name in ("means", "opacities", "colors", "viewmats", "Ks")
    )
    shapes = _expected_shapes(means, colors, viewmats, sh_degree)
    dtype = torch.float64 if means.dtype == torch.float64 else torch.float32
    for name, tensor in tensors.items():
        matches = any(_matches(tensor.shape, shape) for shape in shapes[name])
        if not matches or tensor.dtype != dtype or tensor.device.type != "cpu":
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
        low, high = torch.aminmax(opacities)
        if not (low >= 0 and high <= 1):
            raise ValueError(
                f"opacities: expected numbers in [0, 1], got {low.item()} to {high.item()}"
            )
    if Ks.requires_grad and torch.is_grad_enabled():
        raise NotImplementedError("rasterization: a gradient with respect to Ks is not supported")


def _expected_shapes(
    means: Tensor, colors: Tensor, viewmats: Tensor, sh_degree: int | None
) -> dict[str, list[tuple[int, ...]]]:
    # Slices, as a tensor may have too few dimensions.
    batch, size, cameras = means.shape[:-2], means.shape[-2:-1], viewmats.shape[-3:-2]
    color = (ANY,) if sh_degree is None else (ANY, 3)
    return {
        "means": [(*batch, ANY, 3)],
        "quats": [(*batch, *size, 4)],
        "scales": [(*batch, *size, 3)],
        "opacities": [(*batch, *size)],
        "colors": [(*batch, *size, *color), (*batch, *cameras, *size, *color)],
        "viewmats": [(*batch, ANY, 4, 4)],
        "Ks": [(*batch, *cameras, 3, 3)],
        "backgrounds": [(*batch, *cameras, *colors.shape[-1:])],
    }


def _matches(shape: tuple[int, ...], expected: tuple[int, ...]) -> bool:
    return len(shape) == len(expected) and all(
        wanted in (ANY, length) for length, wanted in zip(shape, expected, strict=True)
    )
