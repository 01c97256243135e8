"""Colours of prints."""

from __future__ import annotations

from gslts_sim.procedural.noise import Colour, Rng

INKS: tuple[Colour, ...] = (
    (0.72, 0.16, 0.14), (0.14, 0.3, 0.55), (0.12, 0.42, 0.3), (0.86, 0.62, 0.15),
    (0.42, 0.2, 0.42), (0.88, 0.42, 0.2), (0.16, 0.48, 0.54), (0.25, 0.22, 0.2),
    (0.62, 0.66, 0.36), (0.8, 0.5, 0.52),
)  # fmt: skip
PAPER: Colour = (0.95, 0.93, 0.87)
BLACK: Colour = (0.08, 0.08, 0.09)


def ink(rng: Rng) -> Colour:
    """Draw one of the printer's colours.

    Args:
        rng: Random stream.
    """
    return INKS[int(rng.integers(len(INKS)))]
