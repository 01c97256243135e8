"""Self-calibration of an RGB-D sensor: focal lengths, principal point, pose of the depth lens.

Nominal intrinsics err by about a percent and the registration of depth by centimetres; a map can be
no sharper. The best poses for colours and for depth of all frames determine the pose of one lens in
the frame of the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gslts.core.camera import Camera, at_pose
from gslts.core.se3 import product, relative, se3_retract, twist_of
from gslts.localization.alignment import Alignment, NormalEquations, solve_positive
from gslts.localization.constants import CORRELATED_PIXELS
from gslts.types import Floats


@dataclass(frozen=True)
class _Prior:
    """Standard deviations of the errors of given lenses.

    Attributes:
        log_focal: Focal lengths of the colour camera, relative.
        centre_share: Its principal point, in widths of the image.
        offset_m, turn_rad: Position and rotation of the depth lens.
    """

    log_focal: float
    centre_share: float
    offset_m: float
    turn_rad: float


NOMINAL = _Prior(log_focal=0.02, centre_share=0.008, offset_m=0.02, turn_rad=0.02)
"""Prior of unregistered depth: nominal values of the type of sensor. In 7-Scenes the
colour camera fits f = 517 px against the nominal 585 and is still found."""
REGISTERED = _Prior(log_focal=0.003, centre_share=0.002, offset_m=0.002, turn_rad=0.002)
"""Prior of registered depth: the sensor was calibrated before."""

_COLOR, _TWIST = slice(0, 4), slice(4, 10)
"""Rows of the 10 unknowns of all lenses: colour intrinsics, and motion of the depth camera."""
_POSE, _INTRINSICS = slice(0, 6), slice(6, 10)
"""Rows of the 10 unknowns of one frame."""


@dataclass(frozen=True)
class Lenses:
    """Colour and depth camera of one sensor, in the frame of the colour camera.

    Attributes:
        color: Colour camera, at the identity pose.
        depth: Depth camera, at the pose color_from_depth.
    """

    color: Camera
    depth: Camera

    def is_close(self, other: Lenses) -> bool:
        """Return whether two sensors are equal up to rounding.

        Args:
            other: Sensor to compare with.
        """
        return (
            at_pose(self.depth, np.eye(4)) == at_pose(other.depth, np.eye(4))
            and self.color == other.color
            and np.allclose(
                self.depth.world_from_camera, other.depth.world_from_camera, rtol=0, atol=1e-6
            )
        )


def pose_step(alignment: Alignment) -> Floats:
    """Return the Gauss-Newton step (6,) of the pose, a twist, with lenses fixed.

    Args:
        alignment: Normal equations of colour and depth.
    """
    both = alignment.color + alignment.depth
    return solve_positive(both.hessian[_POSE, _POSE], both.right[_POSE])


def after_step(alignment: Alignment, step: Floats) -> Alignment:
    """Return the normal equations after a step of the pose, to first order.

    Args:
        alignment: Normal equations before the step.
        step: (6,) twist.
    """

    def without_step(equations: NormalEquations) -> NormalEquations:
        right = equations.right - product(equations.hessian[:, _POSE], step[:, None])[:, 0]
        return NormalEquations(equations.hessian, right)

    return Alignment(without_step(alignment.color), without_step(alignment.depth))


def refine_lenses(lenses: Lenses, given: Lenses, alignments: Sequence[Alignment]) -> Lenses:
    """Take one Gauss-Newton step of the lenses with all poses eliminated (Schur complement).

    A step of a pose changes colour and depth, one of the depth lens changes depth alone, so both
    are determined.

    Args:
        lenses: Current lenses.
        given: Lenses by the data set, mean of the prior.
        alignments: Normal equations of each frame.

    Returns:
        The refined lenses.
    """
    system, right = _eliminate_poses(alignments)
    weights, offset = _prior(lenses, given, len(alignments))
    step = solve_positive(system + np.diag(weights), right + weights * offset)
    # exp(twist) moves the depth lens in the frame of the colour camera, from the left.
    twisted = se3_retract(lenses.color.world_from_camera, step[_TWIST])
    turned = product(twisted, lenses.depth.world_from_camera)
    return Lenses(_change_intrinsics(lenses.color, step[_COLOR]), at_pose(lenses.depth, turned))


def _eliminate_poses(alignments: Sequence[Alignment]) -> tuple[Floats, Floats]:
    """Return matrix [10,10] and right side (10,) of the normal equations of the lenses."""
    system, right = np.zeros((10, 10)), np.zeros(10)
    for alignment in alignments:
        color, depth = alignment.color, alignment.depth
        both = color + depth
        shared, shared_right = np.zeros((10, 10)), np.zeros(10)
        shared[_COLOR, _COLOR] = color.hessian[_INTRINSICS, _INTRINSICS]
        shared[_TWIST, _TWIST] = depth.hessian[_POSE, _POSE]
        shared_right[_COLOR] = color.right[_INTRINSICS]
        shared_right[_TWIST] = depth.right[_POSE]
        mixed = np.concatenate(
            [color.hessian[_POSE, _INTRINSICS], depth.hessian[_POSE, _POSE]], axis=1
        )
        eliminated = solve_positive(
            both.hessian[_POSE, _POSE], np.column_stack([mixed, both.right[_POSE]])
        )
        explained = product(mixed.T, eliminated)
        system += shared - explained[:, :10]
        right += shared_right - explained[:, 10]
    return system, right


def _prior(lenses: Lenses, given: Lenses, frames: int) -> tuple[Floats, Floats]:
    """Return weights (10,) of the prior, and the step (10,) back to the given lenses."""
    registered = np.array_equal(given.depth.world_from_camera, np.eye(4))
    prior = REGISTERED if registered else NOMINAL
    centre_px = prior.centre_share * given.color.width
    stds = np.repeat([prior.log_focal, centre_px, prior.offset_m, prior.turn_rad], [2, 2, 3, 3])
    # Once per frame: the errors of a sensor are the same in all frames and do not average out.
    weights = frames * CORRELATED_PIXELS / stds**2
    back = relative(lenses.depth.world_from_camera, np.eye(4))
    offset = np.concatenate(
        [
            _intrinsics_between(lenses.color, given.color),
            twist_of(product(given.depth.world_from_camera, back)),
        ]
    )
    return weights, offset


def _change_intrinsics(camera: Camera, change: Floats) -> Camera:
    return Camera(
        fx=camera.fx * float(np.exp(change[0])),
        fy=camera.fy * float(np.exp(change[1])),
        cx=camera.cx + float(change[2]),
        cy=camera.cy + float(change[3]),
        width=camera.width,
        height=camera.height,
        world_from_camera=camera.world_from_camera,
    )


def _intrinsics_between(start: Camera, end: Camera) -> Floats:
    """Return the change (4,) of the intrinsics from `start` to `end`."""
    return np.array(
        [
            np.log(end.fx / start.fx),
            np.log(end.fy / start.fy),
            end.cx - start.cx,
            end.cy - start.cy,
        ]
    )
