"""Where Gaussians are added and taken away."""

from __future__ import annotations

import numpy as np

from gslts.gaussian_map import GaussianMap


def joined(old: GaussianMap, new: GaussianMap) -> GaussianMap:
    """Both, the new Gaussians last and with ids that were never used."""
    first = int(old.ids.max()) + 1 if old.size else 0
    return GaussianMap(
        means=np.concatenate([old.means, new.means]),
        quats=np.concatenate([old.quats, new.quats]),
        log_scales=np.concatenate([old.log_scales, new.log_scales]),
        logit_opacities=np.concatenate([old.logit_opacities, new.logit_opacities]),
        sh=np.concatenate([old.sh, new.sh]),
        ids=np.concatenate([old.ids, np.arange(first, first + new.size, dtype=np.uint64)]),
        origin=old.origin,
    )
