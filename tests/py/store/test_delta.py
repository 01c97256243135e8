"""Deltas between versions."""

import numpy as np
import pytest
from store_maps import random_map

from gslts.store.delta import Delta, apply_deltas


def test_a_delta_of_another_map_is_rejected() -> None:
    base = random_map(5)
    nothing = base.select(np.zeros(0, np.int64))
    gone = Delta(np.array([9], np.uint64), nothing, nothing)
    with pytest.raises(ValueError, match="a Gaussian that does not exist"):
        apply_deltas(base, [gone])
