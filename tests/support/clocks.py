"""Clocks for tests, so that nothing depends on how fast a machine is."""

import pytest

from gslts.mapping import clock


class Ticking:
    """A clock that goes on by a fixed time whenever it is read."""

    def __init__(self, tick_s: float) -> None:
        self.tick_s, self.time_s = tick_s, 0.0

    def __call__(self) -> float:
        self.time_s += self.tick_s
        return self.time_s


def make_mapping_tick(patch: pytest.MonkeyPatch, tick_s: float) -> None:
    """Replace the clock of mapping by one that goes on by `tick_s` whenever it is read."""
    patch.setattr(clock, "now_s", Ticking(tick_s))
