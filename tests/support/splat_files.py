"""Independent reader of .splat files."""

import struct
from pathlib import Path

import numpy as np

import gslts
from gslts.core.gaussian_map import SH_C0

ORIGIN = (3.0, -2.0, 0.5)


def decoded(path: Path) -> gslts.GaussianMap:
    """Decode a file byte by byte, as the page of the format's author describes it."""
    content = path.read_bytes()
    rows = [struct.unpack_from("<6f8B", content, at) for at in range(0, len(content), 32)]
    assert len(content) == 32 * len(rows)
    values = np.array(rows)
    opacities = (values[:, 9] / 255).clip(1e-3, 1 - 1e-3)
    return gslts.GaussianMap(
        means=values[:, 0:3],
        quats=(values[:, 10:14] - 128) / 128,
        log_scales=np.log(values[:, 3:6]),
        logit_opacities=np.log(opacities / (1 - opacities)),
        sh=((values[:, 6:9] / 255 - 0.5) / SH_C0)[:, None],
    )
