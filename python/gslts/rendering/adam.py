"""Adam optimizer over the parameters of a map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gslts._core.optim import AdamDouble, AdamFloat, AdamOptions, AdamRates
from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.rendering.rasterizer import Gradients
from gslts.types import Ints, UInts32

__all__ = ["Adam", "AdamOptions", "AdamRates", "AdamState"]

_OPTIMIZERS: dict[np.dtype[Any], type[AdamFloat] | type[AdamDouble]] = {
    np.dtype(np.float32): AdamFloat,
    np.dtype(np.float64): AdamDouble,
}
"""Optimizer of the core by dtype of the map."""
_GROUPS = 7
"""Number of groups of parameters, each with a rate of `AdamRates`."""


@dataclass(frozen=True, eq=False)
class AdamState:
    """Moments of N Gaussians.

    A row holds the moments of a Gaussian's P = 11 + 3 K + D parameters: mean, quaternion, log
    scales, logit opacity, SH, features.

    Attributes:
        first: [N,P] running means of the gradients, in the dtype of the map.
        second: [N,P] running means of their squares.
        steps: [N,7] number of steps that each group of parameters took part in, in the order of
            `AdamRates`, up to 2^20; [N] stands for the same number in all groups.
    """

    first: FloatArray
    second: FloatArray
    steps: UInts32


class Adam:
    """Minimizes a loss over the parameters of a map with Adam (Kingma & Ba 2015).

    A step touches only the Gaussians that have a gradient and the groups of parameters that have a
    rate, and corrects the bias of their moments by the number of steps that each took part in, as
    if each group of a Gaussian had an Adam of its own. With a gradient for all Gaussians this is
    the usual Adam. Results are bit-identical for any number of threads. `step`, `state` and `edit`
    raise RuntimeError while another thread uses the object.

    Args:
        gaussian_map: Initial map; it is copied.
        options: Constants of Adam; None means `AdamOptions()`.
        state: Moments to continue from exactly; None means those before the first step.

    Raises:
        ValueError: An option is out of range, or the state is not of this map: an array has another
            shape or dtype, a moment is not finite or a second one is negative, or a number of steps
            is above 2^20.
    """

    def __init__(
        self,
        gaussian_map: GaussianMap,
        options: AdamOptions | None = None,
        *,
        state: AdamState | None = None,
    ) -> None:
        self._options = AdamOptions() if options is None else options
        optimizer: Any = _OPTIMIZERS[gaussian_map.dtype]
        view = gaussian_map.view()
        if state is None:
            self._core = optimizer(view, options=self._options)
        else:
            steps = state.steps
            if steps.ndim == 1:
                steps = np.repeat(steps[:, None], _GROUPS, axis=1)
            self._core = optimizer(
                view,
                first=state.first,
                second=state.second,
                steps=steps,
                options=self._options,
            )
        self._map = GaussianMap(
            **self._core.arrays(), ids=gaussian_map.ids, origin=gaussian_map.origin
        )
        # Bounds would not follow the steps.
        object.__setattr__(self._map, "bounds", None)

    @property
    def map(self) -> GaussianMap:
        """Current map, a view of the optimizer's memory that changes with every step.

        `map.astype(map.dtype)` is an independent copy.
        """
        return self._map

    @property
    def state(self) -> AdamState:
        """Copy of the moments; `Adam(adam.map, options, state=adam.state)` continues exactly."""
        return AdamState(*self._core.state())

    def step(self, gradients: Gradients, rates: AdamRates, *, threads: int = 0) -> None:
        """Take one step with the Gaussians at `gradients.rows`.

        Args:
            gradients: Gradients of the loss, from `Rasterizer.backward`.
            rates: Learning rates.
            threads: Number of threads; 0 means all.

        Raises:
            ValueError: The gradients do not fit the map, their rows do not ascend, a rate is
                negative or a gradient is not finite; nothing is changed then.
        """
        self._core.step(
            rows=gradients.rows,
            dL_dmeans=gradients.dL_dmeans,
            dL_dquats=gradients.dL_dquats,
            dL_dlog_scales=gradients.dL_dlog_scales,
            dL_dlogit_opacities=gradients.dL_dlogit_opacities,
            dL_dsh=gradients.dL_dsh,
            dL_dfeatures=gradients.dL_dfeatures,
            rates=rates,
            threads=threads,
        )

    def edit(self, gaussian_map: GaussianMap, rows: Ints) -> Adam:
        """Return an optimizer of an edited map with the moments of the Gaussians that are kept.

        Args:
            gaussian_map: Edited map, with the same SH degree and number of features.
            rows: [M] row of each of its Gaussians in this map; -1 for a new one, without moments.

        Raises:
            ValueError: A row does not exist, or `rows` does not fit the map.
        """
        state = AdamState(*self._core.select(rows))
        return Adam(gaussian_map, self._options, state=state)
