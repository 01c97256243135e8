"""Constants of the ROS 2 node."""

MAX_PAIR_GAP_NS = 20_000_000
"""Maximum time between a colour and a depth image of one frame: less than a frame at 30 Hz."""
MAX_WAITING = 5
"""Number of images of a topic that wait for their partner and their pose; 5 MB at 640 x 480 px. At
half, slow odometry (10 Hz) loses frames at 30 Hz."""
MAX_POSE_GAP_NS = 300_000_000
"""Maximum time between two poses to interpolate: a localization by a slow laser publishes its
transform at 5 Hz. At 1 m/s and 1 rad/s, it errs by some millimetres."""
POSE_HISTORY_NS = 10_000_000_000
"""Time for which poses are remembered: 50 kB at 100 Hz, and far more than an image is late."""
CLOCK_JUMP_NS = 1_000_000_000
"""A stamp this much earlier than the last one is of a clock that was set back, not of a late
message."""
SAY_AGAIN_S = 10.0
"""Time after which a problem that lasts is logged again."""
STILL_M, STILL_RAD = 0.01, 0.01
"""Motion since the last frame up to which the robot stands still: the noise of odometry."""
STILL_PERIOD_S = 2.0
"""Time between frames that are compared with the map while the robot stands still."""
WATCH_M, WATCH_RAD = 0.05, 0.05
"""Motion after which a frame counts for the confirmation of changes: frames of a robot that stands
repeat the same error, and an update needs other views anyway."""
KEYFRAME_M, KEYFRAME_RAD = 0.15, 0.26
"""Motion after which a frame is remembered and recorded: successive views share 80 % of a field of
69 degrees. With turns of 0.4 rad, the map of a living room has 27.2 instead of 29.4 dB; at double
the distance, updates lack views, which are 0.25 m apart."""
MAX_KEYFRAMES = 80
"""Number of frames in memory, from which passive updates take their views: 170 MB at 640 x 480 px,
and one round around a table."""
LEAVE_S = 15.0
"""Time without a view of a changed region after which an update uses the views that it has."""
MAX_WAIT_S = 120.0
"""Time after which a change that waits for views is tried with those it has."""
ARRIVED_M, ARRIVED_RAD = 0.3, 0.12
"""Tolerances of a goal: Nav2 has 0.25 m and 0.25 rad by default. The robot may know of obstacles
that the map lacks and stop beside a goal; a wrong direction would miss small regions."""
STUCK_S = 4.0
"""Time without motion after which a goal counts as missed: Nav2 plans again within a second. With
0.15 m and 6 s, views of an update took 8 s each, most of it waiting."""
GOAL_TIMEOUT_S = 90.0
"""Maximum time of a goal: 20 m at 0.25 m/s."""
OBSERVE_TIMEOUT_S = 10.0
"""Maximum time until a frame that was taken after the robot arrived is placed in the map."""
FOREIGN_GOAL_S = 30.0
"""Time for which the robot is left alone after somebody else gave it a goal."""
MAX_REQUESTS = 8
"""Number of requests that wait; more are answered with "busy"."""
MAX_RECORDS_WAITING = 30
"""Number of frames that wait for the disk; 65 MB at 640 x 480 px."""
ROUND_S = 600.0
"""Time after which deferred changes may be tried again, as after a round of `gslts run`."""
DIAGNOSTICS_PERIOD_S = 1.0
"""Time between diagnostics: ROS's tools call a status stale after some seconds."""
VIEW_PERIOD_S = 1.0
"""Minimum time between renderings at the pose of the robot; each takes 0.1 s of a core."""
