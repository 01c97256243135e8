"""Constants of the extension of maps; tuned on development homes (seeds below 5,000)."""

from __future__ import annotations

MAX_SCOUTS = 40
"""Maximum number of frames that are localized without a prior, evenly spread over the recording."""
MIN_ANCHORS = 2
"""Minimum number of frames that must be localized in the map and agree with the odometry."""
MAX_DRIFT_M, MAX_DRIFT_SHARE = 0.15, 0.05
MAX_DRIFT_RAD = 0.1
"""Maximum difference between the motion of two localized frames and that of the odometry: m, plus a
share of the path between them, and rad. Wheel odometry drifts by 1 to 2 % of the path."""

GRID_PX = 8
"""Distance, px, of the pixels of a frame that are compared with the map."""
MIN_SEEN = 2
"""Minimum number of training cameras that must have seen a point, or through it: a single one does
not tell depth and colour of an object from those of its background."""
MIN_KNOWN_ALPHA = 0.7
"""Minimum opacity of the map where it is known, as in change detection."""
MIN_NEW_SHARE = 0.02
"""Minimum share of new pixels of a frame that the map is fitted to."""

SEAM_M = 0.15
"""Distance from new Gaussians within which old ones are refined with them, m."""
MAX_REPLAYS = 16
"""Maximum number of renderings of the old map that hold its side of the seam."""
REPLAY_SEARCH_DIVISOR = 8
"""Divisor of the sides of the images that tell which cameras see the seam."""
MIN_CHANGED_SHARE = 0.02
"""Minimum share of the pixels of a frame by which it shows a change of what the map knows."""
