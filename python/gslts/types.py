"""Names for NumPy arrays by dtype; docstrings give shapes, units and frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Ints = NDArray[np.int64]
Ints32 = NDArray[np.int32]
UInts32 = NDArray[np.uint32]
UInts64 = NDArray[np.uint64]
Indices = NDArray[np.intp]
"""Row numbers, such as those of np.flatnonzero."""
Bools = NDArray[np.bool_]
Bytes = NDArray[np.uint8]
"""8-bit values, such as the colours [H,W,3] of an sRGB image."""
