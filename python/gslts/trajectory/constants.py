"""Constants of the estimation of poses; tuned on development homes (seeds below 5,000)."""

from __future__ import annotations

import numpy as np

KEYPOINTS = 1000
"""Maximum number of keypoints of a frame. A pair of frames is matched far oftener than a frame and
a map, and a recording of a room with plain walls has few matches."""
MAX_FEATURE_DEPTH_M = 6.0
"""Maximum depth of a keypoint, m: the error of structured light grows with the square of it."""

MAX_CLOUD_PX = 320 * 180
"""Maximum number of points of a frame, which are kept for each keyframe: those of 1280 x 720 px at
a quarter of the sides. 640 x 480 px have a third of them, by which `MIN_SHARED_POINTS` was set."""

KEYFRAME_M, KEYFRAME_RAD = 0.2, np.deg2rad(12)
"""Motion since the last keyframe that makes the next one."""
STEP_M, STEP_RAD = 0.6, np.deg2rad(35)
"""Maximum motion between keyframes that follow each other about which there is no doubt: another
place that looks alike is farther away."""
MIN_INLIERS = 20
"""Minimum number of keypoints that two frames share."""
MIN_OVERLAP = 0.3
"""Minimum share of the points of a frame that lie on the surfaces of the other one, as in Open3D's
reconstruction (Choi et al. 2015)."""
CLOUD_VOXEL_M, CLOUD_APART_M = 0.08, 0.1
"""Voxels of the clouds that are registered, and the maximum distance of corresponding points, m:
poses of keypoints err by some centimetres."""

MAX_CONTRADICTION = 0.025
"""Maximum share of the points that one frame shows and the other one saw through. Of frames of the
same place it is at most 0.023 in a real room and 0.005 in simulated homes; of places in a store and
in a tiled room that look alike, 75 % have more than 0.033."""
MAX_SEEN_THROUGH, MIN_SHARED_POINTS, MIN_WITNESSES = 0.01, 200, 2
"""The same share over all placed frames, at most, for a frame that a single motion places: in four
recordings it is at most 0.003 for the right places. At least so many of them must share so many
points with it (of every seventh)."""
MARGIN_M, MARGIN_PER_M = 0.05, 0.03
"""Distance before the surface that a frame measured, from which on it saw through a point, m, and
per metre of depth: noise and the error of the registration."""
CONTRADICTION_STEP, MIN_DEPTH_M = 7, 0.2
"""Every so many points are tested, at least so far from the camera, m."""

GIVEN_POINTS = 100.0
"""Number of points that a given motion weighs, where images tell nothing: a registration has some
thousands."""

MAX_DRIFT_M, MAX_DRIFT_SHARE = 0.15, 0.05
MAX_DRIFT_RAD, MAX_DRIFT_RAD_PER_M, MAX_DRIFT_OF_TURNS = 0.1, 0.02, 0.03
"""Maximum difference between a motion and that of an odometry: m, plus a share of the path between
the frames, and rad, plus rad per metre of the path, plus a share of all turns on it. Wheel odometry
drifts by 1 to 2 % of the path, by about half a degree per metre, and by about 1 % of its turns."""

LOOP_CANDIDATES = 8
"""Number of earlier keyframes that a keyframe is registered with."""
VOTE_STEP = 4
"""Every so many keypoints vote for keyframes: the search takes the square of their number."""
MIN_VOTES = 4
"""Minimum number of votes for a keyframe."""
VOTE_NEIGHBOURS = 4
"""Number of nearest keypoints that each keypoint votes for."""

AGREEMENT_M, AGREEMENT_RAD = 0.1, np.deg2rad(3)
"""Maximum difference of a motion and that over a third frame, which supports it."""
LOOP_DISTANCE_M = 0.05
"""Distance of corresponding points at which a motion is doubted, m: `mu` of Choi et al."""
PRUNE_BELOW = 0.25
"""Confidence below which a motion is removed, as in Open3D's reconstruction."""

MEAN_UP_WEIGHT = 0.02
"""Weight of the mean upward axis of images, and of views upwards or downwards, against that of
horizontal axes."""
MIN_SPREAD = 0.15
"""Mean square of the sine of angles between views and a plane, from which on the images are in
portrait rather than all tilted about one axis: a quarter turn of the camera has 0.18."""
UP_DIRECTIONS = 1000
"""Number of directions of which one is nearly up: about 5 degrees apart."""
PHONE_WEIGHT = 0.17
"""Sine of the mean angle of views in portrait below or above the horizon, from which on they count
as downwards, and thus decide which side is up; otherwise it is the left one, as phones write it."""
MAX_TILT_RAD = np.deg2rad(60)
"""Maximum angle between z and the upward axis by the cameras of a world with z up: cameras that all
look the same way tell their own tilt alone."""
MAX_UP_FRAMES, UP_STRIDE_PX = 30, 8
"""Maximum number of frames whose axes and depths tell what is horizontal, and the step of their
pixels."""
UP_CONES_RAD = tuple(np.deg2rad((25, 12, 6, 3)))
"""Maximum angles between the upward axis and the normals of horizontal surfaces, step by step from
that of the cameras."""
UP_VOXEL_M, NORMAL_RADIUS_M = 0.05, 0.12
"""Voxels and neighbourhood of the points whose normals are estimated, m."""
