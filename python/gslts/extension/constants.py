"""Constants of the extension of maps; tuned on development homes (seeds below 5,000)."""

from __future__ import annotations

MAX_SCOUTS = 40
"""Maximum number of frames that are localized without a prior, evenly spread over the recording."""
MIN_SIGHT_SHARE, SIGHT_MARGIN_M, SIGHT_WIDTH_PX = 0.5, 0.2, 160
"""A frame is localized near a predicted pose if so much of its depth is within that margin of a
rendering of the map, in images of that width: narrower ones blur coarse maps. In two flats, all 231
that were localized had at least 0.56, and of 358 that could not be, half less than 0.5."""
MIN_ANCHORS = 2
"""Minimum number of frames that must be localized in the map and agree with the odometry."""
MAX_OUTLIER_SHARE, MIN_OUTLIERS = 0.2, 3
"""Maximum share of localized frames that contradict the given poses, and minimum number of them to
reject the poses: single frames may be localized wrongly."""
MAX_SCALE_ERROR, MIN_STEP_M, MIN_STEPS = 0.15, 0.3, 5
"""Maximum relative error of the scale of given poses, by the median over steps between localized
frames that are at least so long, and so many. An odometry errs by some per cent."""

GRID_COLUMNS = 40
"""Number of cells in a row of the grid on which a frame is compared with the map."""
MIN_CELLS = 3
"""Minimum width and height of what is new or changed in cells: edges of objects are often misplaced
by one."""
MIN_SEEN = 4
"""Minimum number of training cameras that must have seen a point, or through it, so that another
surface there is a change: what fewer saw, the map may have at a wrong depth."""
MAX_FARTHER, MIN_NEAR = 1.5, 2
"""A surface is known as well as a frame shows it if so many training cameras saw it from at most so
many times as far: what the map saw through a door only, it shows blurred."""
MIN_COLOR_CHANGE = 0.15
"""Minimum colour change of a change, summed over the channels: `tau_gs` of change detection."""
MIN_EXPOSURE_SHARE = 0.1
"""Minimum share of a frame that must agree with the map for its exposure to be fitted."""
MIN_KNOWN_ALPHA = 0.7
"""Minimum opacity of the map where it is known, as in change detection."""
MIN_NEW_SHARE = 0.05
"""Minimum share of new pixels of a frame that the map is fitted to."""

SEAM_SHARE = 0.1
"""Share of the optimization from which on the old Gaussians of the seam are fitted, too. With 0.4,
new space of a room has 0.5 dB less; without, walls around a new door get bright spots."""
MIN_FREE_SHARE, MIN_FREE_PIXELS = 0.5, 10.0
"""Minimum share of the blending weight of an old Gaussian where the map is poor with which it is
refined, and the minimum of that weight, px: less leaks through surfaces."""
MAX_REPLAYS = 16
"""Maximum number of renderings of the old map that hold its side of the seam."""
REPLAY_SEARCH_DIVISOR = 8
"""Divisor of the sides of the images that tell which cameras see the seam."""
MIN_CHANGED_SHARE = 0.005
"""Minimum share of the pixels of a frame by which it shows a change of what the map knows."""
BLUR_SHARE, MIN_EXPOSURE_PIXELS = 0.025, 1000
"""Width of the blur of colours that are compared, as a share of that of the image, and the minimum
number of blurred pixels that tell the exposure of a recording."""
MAX_LOOSE_SHARE = 0.7
"""Maximum share of a frame that does not agree with the map, with which the map determines its
exposure: the rest shows enough colours."""
