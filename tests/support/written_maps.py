"""Maps of any finite numbers, for tests of formats."""

from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import gslts

FINITE = hnp.from_dtype(np.dtype(np.float32), allow_nan=False, allow_infinity=False)
ARRAYS = ("means", "quats", "log_scales", "logit_opacities", "sh", "features", "ids", "origin")


@st.composite
def maps(draw: st.DrawFn, min_size: int = 0) -> gslts.GaussianMap:
    """Draw a map of up to five Gaussians."""
    size = draw(st.integers(min_size, 5))
    bases = draw(st.sampled_from([1, 4, 9, 16]))
    dims = draw(st.integers(0, 3))

    def array(*shape: int) -> Any:
        return draw(hnp.arrays(np.float32, shape, elements=FINITE))

    return gslts.GaussianMap(
        means=array(size, 3),
        quats=array(size, 4),
        log_scales=array(size, 3),
        logit_opacities=array(size),
        sh=array(size, bases, 3),
        features=array(size, dims),
        ids=draw(hnp.arrays(np.uint64, size, unique=True)),
        origin=draw(
            hnp.arrays(np.float64, 3, elements=st.floats(allow_nan=False, allow_infinity=False))
        ),
    )


def assert_same(actual: gslts.GaussianMap, expected: gslts.GaussianMap) -> None:
    """Compare every bit of two maps; of the origin the numbers."""
    for name in ARRAYS:
        a, b = getattr(actual, name), getattr(expected, name)
        assert (a.dtype, a.shape) == (b.dtype, b.shape), name
        assert a.tobytes() == b.tobytes() or (name == "origin" and (a == b).all()), name
