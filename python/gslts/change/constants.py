"""Constants of change detection; tuned on development homes (seeds below 5,000) unless noted."""

from __future__ import annotations

MAX_HALVINGS = 2
"""Maximum halvings of the sides of a frame before the comparison. At a quarter of 640 x 480, 60 %
of single changes are right; at half, 95 % (benchmarks/results/detection.md)."""
ALIGNED_HALVINGS = 2
"""Halvings of the compared image; its pose is aligned from the smallest on. Without any, 5 of 12
poses that err by 10 cm and 4 degrees stay wrong; with one or two none, and 90 frames of real visits
have the same 162 found objects, and 15 or 14 other reports."""

COMPARED_WIDTH_PX = 320
"""Minimum width of a halved frame: the confidence was fitted to images of this width. Smaller ones
show small objects with too few pixels: of 36 changes in six homes, frames of 160 px lead to 24 in
the map, and of 320 px to 33."""
POSE_STDS = (0.01, 0.0087)
"""Standard deviations of a robot's pose, m and rad (half a degree): the prior of the alignment."""
MAX_CORRECTION_M, MAX_CORRECTION_RAD = 0.25, 0.15
"""Maximum correction of a pose, m and rad; 25 or 17 times its standard deviation. A frame that
needs more is unreliable: the alignment has found another optimum, or the pose is no prior."""

NEAR_SIGMAS = 6.0
"""Culls Gaussians within so many of their standard deviations of the camera plane: the affine
projection is invalid there. In a view along a near wall, 75 % of the depths were within 2 % of
the truth; with 3 sigma 62 %, without culling 15 %."""
MAX_CAMERAS = 200
"""Maximum number of training cameras used for visibility. Bounds cost as updates add cameras; 200
matches the maps on which the confidence model was fitted."""

# Frames that are too poor to compare.
MIN_MEASURED_SHARE = 0.1
"""Minimum share of pixels with a depth; with fewer, colours decide alone."""
BLACK, WHITE = 0.03, 0.98
"""Brightness, 0 to 1, below and above which a pixel is clipped."""
MAX_CLIPPED_SHARE = 0.6
"""Maximum share of pixels that are black, or white."""
MIN_KNOWN_SHARE = 0.4
"""Minimum share of the view that the map must cover."""
MIN_SHARPNESS_RATIO = 0.15
"""Minimum variance of second differences of the frame, relative to the rendering, along rows and
columns: motion blur removes one of them."""
SIMILAR = 0.75
"""Minimum cosine of the features of one surface in two images."""
MAX_DISSIMILAR_SHARE = 0.25
"""Maximum share of the known view with dissimilar features; changed objects cover less."""
MAX_ALIGNED_SHARE, MAX_ALIGNED_DEPTHLESS_SHARE = 0.5, 0.4
"""The same in frames that agree with the map far better as they are than displaced, with and
without depth to confirm it: light that changed and nudged furniture make as much dissimilar."""
MIN_ALIGNMENT_PEAK = 2.4
"""How much better, see `alignment_peak`. Of 90 frames of real visits, with and without depth, 89
have more, and 2 of the same frames mirrored, one of which looks along the middle of a room."""
PEAK_STEP_SHARE, PEAK_STEPS = 0.075, 2
"""Step of these displacements, as a share of the width, and their number in each direction."""
MIN_DEVIATION = 1e-6
"""Minimum standard deviation of the mean cosines of displaced images; less is rounding."""
MAX_CHANGED_SHARE = 0.4
"""Maximum share of the known view covered by changes; if more differs, the pose or the map is
wrong."""
DEPTH_TOLERANCE = 0.06
"""Maximum difference of measured and rendered depth on one surface, relative to the depth."""
MIN_AGREEING_SHARE, MIN_COARSE_AGREEING_SHARE = 0.5, 0.4
"""Minimum share of measured depths within `DEPTH_TOLERANCE` of the map; changed objects cover
less than the rest. The second one is for coarse depth: of 90 frames of real visits 89 have more."""

# Confirmation of changes over recorded frames.
MIN_RECORDED_CONFIDENCE = 0.65
"""Minimum confidence that recorded frames must give a change together; one frame may be enough. In
15 real visits (90 frames) it is, in steps of 0.05, the lowest with at most 0.05 other reports a
frame, and so it is in each two of the three rooms. 0.8 finds 7 of 102 objects fewer, with 2 instead
of 4 other reports; 0.5 finds 2 more, with 11. Updates by these visits then show 32 changes that
happened and none that did not; with 0.8 it was 29 and two."""

# Coarse depth.
MAX_FINE_QUANTUM_M = 0.025
"""Maximum step, m, between the distinct depths of fine depth: that of a Kinect at 3 m. Real ones of
3.9 cm drown an object of some centimetres together with the surface around it."""
MIN_DISTINCT_DEPTHS = 8
"""Minimum number of distinct depths of a frame that tell their step: one wall has a few."""
DEPTH_SAMPLES = 20_000
"""Maximum number of depths that are looked at; all of them take 20 ms longer."""

# Blurred parts of a frame (blur.py). In 79 frames of real rooms at most 7 % of what has detail
# counts as blurred; with one half of the image smeared 30 % in the median.
BLUR_WINDOW_SHARE = 1 / 8
"""Side of the window around a pixel in which detail is compared, as a share of the width."""
MIN_DETAIL = 0.01
"""Minimum root mean square of second differences, brightness from 0 to 1: noise has less."""
BLUR_SIGMA_SHARE = 1 / 40
"""Standard deviation, as a share of the width, of the blur after which frame and rendering are
compared: more than that of a smear."""
MIN_BLUR_AGREEMENT = 0.5
"""Minimum covariance then, as a share of the larger variance: what is there instead of a removed
object has less."""
MIN_BLURRED_SHARE = 0.08
"""Minimum share of what has detail that is blurred; less can be chance."""

# Regions that cannot be judged.
MIN_UNKNOWN_SHARE = 0.01
"""Minimum share of the image of a region that is reported as unknown."""
MIN_WITNESSES, MAX_WITNESS_SHARE = 3, 0.05
"""Minimum number of training cameras that must have seen a position, or through it, so that it is
known that nothing was there: what fewer saw, the map may have at a wrong depth. With few cameras,
this share of them suffices, rounded up: maps of 4 to 8 frames know nothing better."""
MIN_MAP_WITNESSES = 2
"""The same for a surface of the map: a second camera shows that it is no error of the first one."""
MIN_SEEN_SHARE = 0.5
"""Minimum share of a surface's samples at known positions."""
MAX_THROUGH_SHARE = 0.3
"""Maximum share of the cameras that saw through a surface of the map, among those that saw it or
through it. Of 73 true removals in a kitchen and the bookstore at most 0.13, of false ones from
rendered edges 0.38 to 0.94."""
MIN_RECORDING_FRAMES, MIN_RECORDED_RATE, MAX_RECORDED_SHARE = 2, 0.25, 0.6
"""Number of frames of the recording that must have measured a surface at a point, and share of them
in those that measured it there or behind; and share of such points from which on the surface is not
new. Of true ones, 3 of 277 in fine maps (640 x 480) and 4 of 86 in coarse ones (320 x 240) have
more, of false ones 77 of 96 in the latter; without the rate and with 0.7, it was 13, 4 and 80."""
MIN_FREE_SHARE = 0.4
"""Minimum share of such a surface that so many frames of the recording saw through. Of 151 objects
that came at least 0.5, of an unseen side of a chair at most 0.34."""
MAX_MISSING_SHARE = 0.55
"""Maximum share of a surface of the map that so many frames of the recording saw through and fewer
measured. Of 193 removed objects in five homes and the bookstore at most 0.51, of 38 of 48 errors of
the maps more."""
MOVED_MARGIN_M = 0.05
"""Margin of the box of an object that left or came: what comes there may be new, or goes again."""
MIN_MEASURED_WEIGHT = 0.5
"""Minimum weight of measured Gaussians among those that a pixel shows. Of true removals in the
bookstore the mean of a region is at least 0.82, of false ones before windows and sky at most 0.56.
"""
MIN_ERROR_ALPHA = 0.1
"""Minimum alpha by which the expected errors of a pixel are divided; with less, it is not compared.
"""

# What updates added, where colours decide.
MIN_CAME_SHARE = 0.5
"""Minimum mean weight of such Gaussians in the pixels of a region. Of 37 such regions in real
visits, 36 were of objects that had gone, 21 of them with a confidence of 0.5; of 18 others one."""
CAME_LOG_ODDS = 2.0
"""Added to the log odds of such a region: 7 times as likely."""

# Exposure of a frame in which something changed.
EXPOSURE_REFITS = 2
"""Number of fits without outliers after the first one."""
OUTLIER_FACTOR = 2.5
"""Errors above so many times the median error are outliers."""
MIN_OUTLIER_ERROR = 0.02
"""Floor of the median error, 0 to 1, about the noise of a sensor: without it, a nearly perfect fit
would reject good pixels."""

# Oriented gradients.
ORIENTATIONS = 8
"""Number of gradient orientations over 2 pi, as in DAISY (Tola et al. 2010)."""
POOLING_SIGMAS = (0.006, 0.02)
"""Standard deviations of the Gaussian pooling, relative to the width of the image."""
GRADIENT_FLOOR = 0.02
"""Constant feature, brightness per pixel: gradients well below it, the noise of a sensor, do not
change the cosine of plain surfaces."""

# Visibility.
VISIBILITY_RANGE_M = 10.0
"""Maximum distance of surfaces in the depth images of the training cameras, m: depth cameras
measure to 10 m at most, and what is seen through has a surface behind it."""
VISIBILITY_WIDTH_PX = 160
"""Width of the depth images of the training cameras: a pixel is about 2 cm at 3 m."""
MAX_PROJECTIONS = 1 << 18
"""Points times cameras projected at a time; bounds the memory at tens of MB."""
