"""Maps of random numbers and the columns of their PLY files."""

from typing import Any

import numpy as np
import scenes
from numpy.typing import NDArray

import gslts


def columns_of(gaussians: gslts.GaussianMap) -> dict[str, NDArray[np.float32]]:
    """The properties of 3DGS in its order, written out from its definition."""
    rest = (
        gaussians.sh[:, 1:]
        .transpose(0, 2, 1)
        .reshape(gaussians.size, 3 * gaussians.sh.shape[1] - 3)
    )
    columns = {name: gaussians.means[:, i] for i, name in enumerate("xyz")}
    columns |= {name: np.zeros(gaussians.size, np.float32) for name in ("nx", "ny", "nz")}
    columns |= {f"f_dc_{i}": gaussians.sh[:, 0, i] for i in range(3)}
    columns |= {f"f_rest_{i}": rest[:, i] for i in range(rest.shape[1])}
    columns |= {"opacity": gaussians.logit_opacities}
    columns |= {f"scale_{i}": gaussians.log_scales[:, i] for i in range(3)}
    columns |= {f"rot_{i}": gaussians.quats[:, i] for i in range(4)}
    return columns


def float_map(size: int, **options: Any) -> gslts.GaussianMap:
    """Return a map of random numbers in float32, as PLY files hold them."""
    return scenes.random_map(size, dtype=np.float32, **options)
