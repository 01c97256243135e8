"""Constants of the consolidation of maps; tuned on development homes (seeds below 5,000)."""

from __future__ import annotations

MAX_VIEWS = 60
"""Maximum number of views. After 25 changes of a kitchen, 30 views gain 0.1 dB, 60 gain 0.5 dB and
100 gain 0.6 dB."""
EPOCHS = 12
"""Number of steps on each view; 30 instead of 12 gain 0.03 dB in the same kitchen."""
REACH_M = 0.45
"""Maximum distance of a refined Gaussian from the box of a change, m, as in updates; with 0.2 m,
half of the gain is lost."""
MARGIN_PX = 20
"""Margin around the boxes in which held-out views are compared, px, as in updates."""
MIN_GAIN_DB = 0.09
"""Minimum gain of validation views around the changes, dB: 2 % of their error, as in updates."""
MAX_UNKNOWN_CHANGES = 6
"""Maximum number of changes that the views show and the map does not. In a kitchen after 25 changes
with updates, 60 views showed 3; they showed 15 in the state before these changes, and the fit would
have been a mixture of both states."""
MIN_CHANGE_VIEWS = 3
"""Minimum number of views that show a change for it to count, as in rounds of a robot."""
MAX_CORRECTION_M = 0.1
"""Maximum distance between the given and the aligned position of a view, m; a larger one means that
the view cannot be aligned with the map."""
