"""Adam over the parameters of a map: how a map is fitted to images."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts._core.optim import AdamDouble, AdamFloat, AdamOptions, AdamRates
from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.rendering.rasterizer import Gradients

__all__ = ["Adam", "AdamOptions", "AdamRates", "AdamState"]

_OPTIMIZERS: dict[np.dtype[Any], type[AdamFloat] | type[AdamDouble]] = {
    np.dtype(np.float32): AdamFloat,
    np.dtype(np.float64): AdamDouble,
}


@dataclass(frozen=True, eq=False)
class AdamState:
    """All that Adam remembers of N Gaussians.

    A row holds the moments of a Gaussian's P = 11 + 3 K + D parameters: mean, quaternion, log
    scales, logit opacity, SH, features.

    Attributes:
        first: [N,P] running means of the gradients, of the map's dtype.
        second: [N,P] running means of their squares.
        steps: [N] uint32, steps that each Gaussian took part in.
    """

    first: FloatArray
    second: FloatArray
    steps: NDArray[np.uint32]


class Adam:
    """Adam (Kingma & Ba 2015) over the parameters of a map.

    A step touches only the Gaussians that have a gradient, and corrects the bias of their moments
    by the number of steps that each took part in: every Gaussian moves as if an Adam of its own had
    seen just those steps. With a gradient for all, this is the usual Adam. Results are
    bit-identical for any thread count.

    Args:
        gaussian_map: Where to start; it is copied.
        options: The constants of Adam; None means `AdamOptions()`.
        state: To go on from, exactly; None means before the first step.

    Raises:
        ValueError: An option is out of range, or the state is not of this map.
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
            self._core = optimizer(
                view,
                first=state.first,
                second=state.second,
                steps=state.steps,
                options=self._options,
            )
        self._map = GaussianMap(
            **self._core.arrays(), ids=gaussian_map.ids, origin=gaussian_map.origin
        )

    @property
    def map(self) -> GaussianMap:
        """The map as it is now: one object, whose numbers move with every step.

        `map.astype(map.dtype)` is a copy that stays.
        """
        return self._map

    @property
    def state(self) -> AdamState:
        """A copy of the moments; `Adam(adam.map, options, state=adam.state)` goes on exactly."""
        return AdamState(*self._core.state())

    def step(self, gradients: Gradients, rates: AdamRates, *, threads: int = 0) -> None:
        """Moves the Gaussians at `gradients.rows`.

        Args:
            gradients: Of a loss to be made smaller, from `Rasterizer.backward`.
            rates: Learning rates.
            threads: 0 means one a hardware thread.

        Raises:
            ValueError: The gradients do not fit the map, their rows do not ascend, a rate is
                negative or a gradient is not finite; then nothing has changed.
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

    def edited(self, gaussian_map: GaussianMap, rows: NDArray[np.int64]) -> Adam:
        """Goes on with an edited map, to which the moments of the Gaussians that stayed move along.

        Args:
            gaussian_map: The edited map, with the same SH degree and number of features.
            rows: [M] int64, where each of its Gaussians was in this map; -1 for a new one, which
                starts without moments.

        Raises:
            ValueError: There is no such row, or `rows` does not fit the map.
        """
        state = AdamState(*self._core.select(rows))
        return Adam(gaussian_map, self._options, state=state)
