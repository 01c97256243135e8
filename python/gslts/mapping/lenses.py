"""The lenses of an RGB-D sensor: what they are taken for, and their correction.

Nominal focal lengths and a registration by a driver err by a percent and some centimetres, and no
map is sharper than these. Where the colours of all frames fit best and where their depths do tells
how the two lenses stand to each other.
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
class _Trust:
    """How far what the data set says is expected to be off (standard deviations).

    Attributes:
        log_focal: Focal lengths of the colour camera, relative.
        centre_share: Its principal point, in widths of the image.
        offset_m, turn_rad: The depth lens.
    """

    log_focal: float
    centre_share: float
    offset_m: float
    turn_rad: float


NOMINAL = _Trust(log_focal=0.02, centre_share=0.008, offset_m=0.02, turn_rad=0.02)
"""Two lenses with the nominal values of their kind."""
REGISTERED = _Trust(log_focal=0.003, centre_share=0.002, offset_m=0.002, turn_rad=0.002)
"""Depth that was registered before: somebody has calibrated the sensor."""

_COLOR, _TWIST = slice(0, 4), slice(4, 10)
_POSE, _INTRINSICS = slice(0, 6), slice(6, 10)


@dataclass(frozen=True)
class Lenses:
    """Colour and depth camera of one sensor, in the frame of the colour camera.

    Attributes:
        color: At the identity pose.
        depth: At color_from_depth.
    """

    color: Camera
    depth: Camera

    def alike(self, other: Lenses) -> bool:
        """Whether both are the same but for rounding."""
        return (
            at_pose(self.depth, np.eye(4)) == at_pose(other.depth, np.eye(4))
            and self.color == other.color
            and np.allclose(
                self.depth.world_from_camera, other.depth.world_from_camera, rtol=0, atol=1e-6
            )
        )


def pose_step(alignment: Alignment) -> Floats:
    """(6,) the twist of the pose that fits both images best, the lenses as they are."""
    both = alignment.color + alignment.depth
    return solve_positive(both.hessian[_POSE, _POSE], both.right[_POSE])


def after_step(alignment: Alignment, step: Floats) -> Alignment:
    """The same equations for what is left once the pose has moved by a twist (6,)."""

    def left(equations: NormalEquations) -> NormalEquations:
        right = equations.right - product(equations.hessian[:, _POSE], step[:, None])[:, 0]
        return NormalEquations(equations.hessian, right)

    return Alignment(left(alignment.color), left(alignment.depth))


def corrected_lenses(lenses: Lenses, given: Lenses, looks: Sequence[Alignment]) -> Lenses:
    """Lenses that fit all looks best, each of which may move its pose as well.

    The pose of a colour camera shows in colour and depth, a twist of the depth lens in depth alone;
    with the poses eliminated (Schur complement), both can be told apart.
    """
    system, right = np.zeros((10, 10)), np.zeros(10)
    for look in looks:
        color, depth = look.color, look.depth
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
    registered = np.array_equal(given.depth.world_from_camera, np.eye(4))
    trust = REGISTERED if registered else NOMINAL
    centre_px = trust.centre_share * given.color.width
    stds = np.repeat([trust.log_focal, centre_px, trust.offset_m, trust.turn_rad], [2, 2, 3, 3])
    # Once a look: the errors of a sensor are the same in all of them and do not average out.
    prior = len(looks) * CORRELATED_PIXELS / stds**2
    back = relative(lenses.depth.world_from_camera, np.eye(4))
    off = np.concatenate(
        [
            _intrinsics_between(lenses.color, given.color),
            twist_of(product(given.depth.world_from_camera, back)),
        ]
    )
    step = solve_positive(system + np.diag(prior), right + prior * off)
    # exp(twist) moves the depth lens in the colour camera's frame, from the left.
    twisted = se3_retract(lenses.color.world_from_camera, step[_TWIST])
    turned = product(twisted, lenses.depth.world_from_camera)
    return Lenses(_changed(lenses.color, step[_COLOR]), at_pose(lenses.depth, turned))


def _changed(camera: Camera, change: Floats) -> Camera:
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
    """(4,) the change that makes `end` of `start`."""
    return np.array(
        [
            np.log(end.fx / start.fx),
            np.log(end.fy / start.fy),
            end.cx - start.cx,
            end.cy - start.cy,
        ]
    )
